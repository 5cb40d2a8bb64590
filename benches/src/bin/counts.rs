//! Runs a small workload under valgrind. `cargo xtask bench counts` compares its instructions with `counts.json`.
//!
//! Without arguments the program prints the names of the workloads. With a name it runs this workload; the counted
//! instructions are those inside [`counted`].

#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "prints the names")]

use std::error::Error;

use cloth_verlet::ClothParams;
use papsynth_benches::{
    Workload, at_density, blur, cytoskeleton, default_recipe, exposure, fields, peer_recipe, perlin, sheets, texture,
    thickness,
};

/// Image size of small workloads.
const SMALL: [usize; 2] = [192, 144];

/// Field size of small workloads: a few cells.
const FIELD: [usize; 2] = [344, 260];

/// Name of a workload, number of runs before counting, and constructor.
type Counted = (&'static str, usize, fn() -> Workload);

/// All workloads: name, number of runs before counting, and constructor. The first run creates cached tables. The four
/// periodic diagrams of the cytoskeleton are created on demand; the number of runs suffices to create all of them.
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
    let (_, before, make) = WORKS.iter().find(|work| work.0 == name).ok_or("unknown workload")?;
    let mut work = make();
    (0..*before).for_each(|_| work());
    counted(&mut work);
    Ok(())
}

/// Runs a workload. valgrind counts the instructions of this function, by its name.
#[inline(never)]
fn counted(work: &mut Workload) {
    work();
}
