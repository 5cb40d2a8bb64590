//! Does one small work under valgrind: `cargo xtask bench counts` compares how many instructions it takes with `counts.json`.
//!
//! Without arguments the program prints the names of the works. With a name it does this work, whose instructions are those inside [`counted`].

#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "the names are its output")]

use std::error::Error;

use cloth_verlet::ClothParams;
use papsynth_benches::{
    Work, at_density, blur, cytoskeleton, default_recipe, exposure, fields, peer_recipe, perlin, sheets, texture,
    thickness,
};

/// An image of small works.
const SMALL: [usize; 2] = [192, 144];

/// A field of small works: a few cells.
const FIELD: [usize; 2] = [344, 260];

/// What is counted of a work: its name, how often it is done before, and what makes it.
type Counted = (&'static str, usize, fn() -> Work);

/// Every work: its name, how often it is done before it is counted, and what makes it. The first time makes tables that are made
/// once; a few cells a field meet the four periodic diagrams of the cytoskeleton only by and by: as many fields as meet them all.
const WORKS: [Counted; 12] = [
    ("sheets_paper", 1, || sheets(&ClothParams { steps: 6, ..ClothParams::paper() })),
    ("sheets_default", 1, || sheets(&ClothParams { steps: 2, ..ClothParams::default() })),
    ("thickness", 1, thickness),
    ("blur_0_9", 1, || blur(SMALL, 0.9)),
    ("blur_3_6", 1, || blur(SMALL, 3.6)),
    ("blur_20", 1, || blur(SMALL, 20.0)),
    ("exposure", 1, || exposure(SMALL)),
    ("texture", 1, texture),
    ("cytoskeleton", 1, cytoskeleton),
    ("perlin", 1, || perlin(SMALL)),
    ("frame_peer", 8, || fields(&at_density(peer_recipe(), FIELD))),
    ("frame_default", 8, || fields(&at_density(default_recipe(), FIELD))),
];

fn main() -> Result<(), Box<dyn Error>> {
    let Some(name) = std::env::args().nth(1) else {
        WORKS.iter().for_each(|(name, ..)| println!("{name}"));
        return Ok(());
    };
    let (_, before, make) = WORKS.iter().find(|work| work.0 == name).ok_or("there is no such work")?;
    let mut work = make();
    (0..*before).for_each(|_| work());
    counted(&mut work);
    Ok(())
}

/// Does a work; valgrind counts what happens in here, by the name of this function.
#[inline(never)]
fn counted(work: &mut Work) {
    work();
}
