use papsynth_judge::*;
use rayon::prelude::*;
fn read(dir: &str, from: NucleiFrom) -> Vec<Field> {
    let mut files: Vec<_> = std::fs::read_dir(dir).unwrap().map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "png")).collect();
    files.sort();
    let only = std::env::var("ONLY").unwrap_or_default();
    files.par_iter().filter_map(|f| {
        let im = image::open(f).unwrap().to_luma8();
        let w = im.width() as usize;
        let csv = f.with_extension("csv");
        let mut nuclei = Known::Nothing;
        if let Ok(t) = std::fs::read_to_string(csv) {
            nuclei = Known::Points(t.lines().filter_map(|l| { let mut i = l.split(',').map(|v| v.parse::<f64>().ok()); let y = i.next()??; let x = i.next()??; Some([x, y]) }).collect());
        } else if let Ok(t) = std::fs::read_to_string(f.parent().unwrap().parent().unwrap().join("objects").join(f.with_extension("csv").file_name().unwrap())) {
            nuclei = Known::Points(t.lines().skip(1).filter_map(|l| { let c: Vec<&str> = l.split(',').collect(); (c[2] == "nucleus").then(|| Some([c[21].parse().ok()?, c[22].parse().ok()?])).flatten() }).collect());
        }
        let name = f.file_stem().unwrap().to_string_lossy().to_string();
        if let Ok(t) = std::fs::read_to_string(f.parent().unwrap().join("frames.csv")) {
            let g = t.lines().find_map(|l| l.split_once(',').filter(|(n, _)| *n == name)).unwrap().1.to_string();
            if !only.is_empty() && !only.contains(&g) { return None; }
        }
        let p = Picture { name, group: String::new(), grey: im.into_raw().into_iter().map(f32::from).collect(), width: w, full_scale: 255.0, nuclei };
        let t = std::time::Instant::now();
        let r = Gauge::new(&GaugeParams { nuclei_from: from, ..Default::default() }).unwrap().measure(&p).unwrap();
        if std::env::var("V").is_ok() { eprintln!("{:?} {} nuclei {} patches {:?}", f, r.nuclei.len(), r.patches.len(), t.elapsed()); }
        Some(r)
    }).collect()
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let from = if a.get(3).is_some_and(|s| s == "points") { NucleiFrom::Points } else { NucleiFrom::Search };
    let t = std::time::Instant::now();
    let (real, syn) = (read(&a[1], from), read(&a[2], from));
    eprintln!("measured {:?}", t.elapsed());
    let names: Vec<&str> = real[0].statistics.scalars().iter().map(|s| s.0).collect();
    let q = |f: &[Field], g: &dyn Fn(&Field) -> f64| { let mut v: Vec<f64> = f.iter().map(g).filter(|v| v.is_finite()).collect(); v.sort_by(f64::total_cmp); let n = v.len(); if n == 0 { return [f64::NAN; 3] } [v[n / 10], v[n / 2], v[(n * 9 / 10).min(n - 1)]] };
    for (i, n) in names.iter().enumerate() { println!("{n:<40} {:.4?}   {:.4?}", q(&real, &|f| f.statistics.scalars()[i].1), q(&syn, &|f| f.statistics.scalars()[i].1)); }
    for i in 0..10 { println!("profile {i} {:.3?}  {:.3?}", q(&real, &|f| f.statistics.profile[i]), q(&syn, &|f| f.statistics.profile[i])); }
    println!("cells {} {}", real.iter().map(|f| f.statistics.cells).sum::<usize>(), syn.iter().map(|f| f.statistics.cells).sum::<usize>());
    let t = std::time::Instant::now();
    let r = Judge::new(&JudgeParams::default()).unwrap().compare(&real, &syn).unwrap();
    eprintln!("judged {:?}", t.elapsed());
    for t in &r.two_sample {
        let r = &t.result;
        println!("== {}: {} {:?} rows in {:?} fields: AUC {:.3} [{:.3}, {:.3}]; real halves ({} rows a half): {:?}", t.name, t.verdict, r.rows, r.fields, r.auc, r.interval[0], r.interval[1], r.null_rows, r.null.iter().map(|v| (v * 100.0).round() / 100.0).collect::<Vec<_>>());
        println!("families alone: {}", r.families.iter().map(|f| format!("{:?} {:.2} ", f.family, f.auc)).collect::<String>());
        println!("{:>6} {:>6}  {:<42} {:>9} {:>9} {:>9}   {:>9} {:>9} {:>9}", "import", "alone", "feature", "real p10", "p50", "p90", "syn p10", "p50", "p90");
        for g in r.giveaways.iter().take(40) {
            println!("{:6.3} {:6.3}  {:<42} {:9.4} {:9.4} {:9.4}   {:9.4} {:9.4} {:9.4}", g.importance, g.alone, g.feature, g.real[0], g.real[1], g.real[2], g.synthetic[0], g.synthetic[1], g.synthetic[2]);
        }
    }
    for t in &r.moments { println!("== {}: {}", t.name, t.verdict); for d in &t.result.descriptors { println!("{:<16} slope {:.2?} null {:.2?} shift {:.2?} null {:.2?}", d.name, d.slope, d.null_slope, d.shift, d.null_shift); } }
    println!("{:?}", r.notes);
    if let Ok(f) = std::env::var("HTML") { std::fs::write(f, r.to_html()).unwrap(); }
}
