//! s
use perlin_bg::*; use std::io::Write;
fn main(){ let (w,h)=(1376,1038); let mut p=BackgroundParams::default(); p.illumination=Illumination::Bowl{x2:0.,y2:0.,tilt:[0.,0.]}; let mut o=std::fs::File::create("/tmp/bg.f32").unwrap();
 p.scatter.strength=0.03; p.scatter.cell_px=std::env::args().nth(1).unwrap().parse().unwrap();
 for k in 0..24 { let mut im=vec![0f32;w*h]; Background::new(&p,w,h,k).unwrap().transmitted_into(&mut im,w,[0,0]); for v in &im { o.write_all(&v.to_le_bytes()).unwrap(); } } }
