//! How many instructions do small works take? `cargo xtask bench counts` compares them with those kept in `counts.toml`.

#![expect(missing_docs, reason = "the macros write functions without words")]

use cloth_verlet::ClothParams;
use gungraun::{Callgrind, LibraryBenchmarkConfig, library_benchmark, library_benchmark_group, main};
use papsynth_benches::{
    Work, at_density, blur, cytoskeleton, default_recipe, exposure, fields, peer_recipe, perlin, sheets, texture,
    thickness,
};

/// An image of small works.
const SMALL: [usize; 2] = [192, 144];

/// A field of small works: a few cells.
const FIELD: [usize; 2] = [344, 260];

/// A work after it was done once, so that tables which are made once are not counted.
fn warm(mut work: Work) -> Work {
    work();
    work
}

/// A few cells a field meet the four periodic diagrams of the cytoskeleton only by and by: as many fields as meet them all.
fn warm_fields(mut work: Work) -> Work {
    for _ in 0..8 {
        work();
    }
    work
}

fn paper_sheets() -> Work {
    warm(sheets(&ClothParams { steps: 6, ..ClothParams::paper() }))
}

fn default_sheets() -> Work {
    warm(sheets(&ClothParams { steps: 2, ..ClothParams::default() }))
}

fn folded_sheet() -> Work {
    warm(thickness())
}

fn small_blur(sigma_px: f64) -> Work {
    warm(blur(SMALL, sigma_px))
}

fn small_exposure() -> Work {
    warm(exposure(SMALL))
}

fn nucleus() -> Work {
    warm(texture())
}

fn cell() -> Work {
    warm(cytoskeleton())
}

fn small_octave() -> Work {
    warm(perlin(SMALL))
}

fn small_peer() -> Work {
    warm_fields(fields(&at_density(peer_recipe(), FIELD)))
}

fn small_default() -> Work {
    warm_fields(fields(&at_density(default_recipe(), FIELD)))
}

#[library_benchmark]
#[bench::sheets_paper(setup = paper_sheets)]
#[bench::sheets_default(setup = default_sheets)]
#[bench::thickness(setup = folded_sheet)]
#[bench::blur_0_9(args = (0.9), setup = small_blur)]
#[bench::blur_3_6(args = (3.6), setup = small_blur)]
#[bench::blur_20(args = (20.0), setup = small_blur)]
#[bench::exposure(setup = small_exposure)]
#[bench::texture(setup = nucleus)]
#[bench::cytoskeleton(setup = cell)]
#[bench::perlin(setup = small_octave)]
#[bench::frame_peer(setup = small_peer)]
#[bench::frame_default(setup = small_default)]
fn once(mut work: Work) -> Work {
    work();
    work
}

library_benchmark_group!(name = works, benchmarks = once);

/// Makes the C library clear and copy memory by plain vectors at every size. Else it goes by the caches of the machine, and a string
/// instruction counts once for each byte.
const PLAIN_MEMORY: &str = "glibc.cpu.x86_rep_movsb_threshold=0xffffffffffffffff:\
                            glibc.cpu.x86_rep_stosb_threshold=0xffffffffffffffff:\
                            glibc.cpu.x86_non_temporal_threshold=0xfffffffffffffff";

main!(
    config = LibraryBenchmarkConfig::default()
        .tool(Callgrind::with_args(["--cache-sim=no"]))
        .env("GLIBC_TUNABLES", PLAIN_MEMORY),
    library_benchmark_groups = works
);
