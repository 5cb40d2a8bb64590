//! Whole slides from the command line.

#[allow(dead_code, reason = "each test uses its part")]
use std::fs;

use crate::support::Bench;

/// Small frames and a deposit near the corner, so that a part takes no time.
const SMALL: &str = "--preset sparse --set scan.frame_px=256 --set scan.deposit.x_um=80 --set scan.deposit.y_um=80";

fn refused(bench: &Bench, words: &str, why: &str) {
    let run = bench.run(words);
    assert!(run.code == 2 && (run.err.contains(why) || run.out.contains(why)), "{words}: {} {}", run.out, run.err);
}

#[test]
fn any_part_of_a_slide_is_made_alone() {
    let bench = Bench::new("slide-tile");
    let tile = |name: &str, at: &str| {
        bench.good(&format!("slide tile {SMALL} --at {at} --size 200,150 --out {name}"));
        fs::read(bench.path(name)).unwrap()
    };
    let one = tile("one.png", "300,200");
    assert!(one == tile("again.png", "300,200"));
    assert!(one != tile("other.png", "301,200"));
    refused(&bench, "slide tile --at 55999,0 --size 100,100 --out no.png", "leave the slide of 56000 x 56000");
    refused(&bench, "slide tile --at 0,0 --size 99999,99999 --out no.png", "at once");
    refused(&bench, "slide tile --at 0 --out no.png", "two whole numbers");
    refused(&bench, "slide tile --at 0,0 --out no.png --set scan.frame_px=9", "scan.frame_px");
    refused(&bench, "slide tile --at 0,0 --out no.png --set layout.kind=band", "layout.kind");
    refused(&bench, "slide tile --at 0,0 --out no.png --set optics.imaging=abbe", "optics.imaging");
    refused(
        &bench,
        "slide tile --at 27000,27000 --out no.png --set scan.max_object_radius_um=20",
        "scan.max_object_radius_um",
    );
    refused(&bench, "slide tile --at 0,0 --size 20,20 --out no.jpg", "ends in .png");
    let planes = bench.good(&format!("slide tile {SMALL} --at 0,0 --size 20,20 --out planes.png --set focus.planes=3"));
    assert!(planes.err.contains("of 3 planes the middle one"), "{}", planes.err);
    fs::create_dir(bench.path("folder.png")).unwrap();
    refused(&bench, "slide tile --at 0,0 --size 20,20 --out folder.png", "folder.png");
    assert!(!bench.path("no.png").exists());
}

#[test]
#[cfg(not(feature = "zarr"))]
fn a_build_without_zarr_says_what_it_lacks() {
    let bench = Bench::new("slide-lean");
    refused(&bench, "slide make --out slide", "--features zarr");
    assert!(!bench.path("slide").exists());
}

#[test]
#[cfg(feature = "zarr")]
fn a_slide_made_in_shares_is_closed_and_verified() {
    let bench = Bench::new("slide-make");
    let make = format!("slide make {SMALL} --out slide --size 900,600 --shard-px 512");
    refused(&bench, &format!("{make} --max-memory 20MB"), "may be used");
    refused(&bench, &format!("{make} --set scan.max_object_radius_um=20"), "scan.max_object_radius_um");
    assert!(!bench.path("slide").exists());
    // The same files with as much as one thread needs.
    bench.good(&format!("{make} --threads 8 --max-memory 300MiB"));
    bench.good(&format!("slide make {SMALL} --out other --size 900,600 --shard-px 512 --threads 1"));
    assert_eq!(bench.files("slide"), bench.files("other"));
    fs::remove_dir_all(bench.path("slide")).unwrap();
    bench.good(&format!("{make} --shard 0/2"));
    refused(&bench, "slide finalize slide", "shards are missing or damaged");
    assert_eq!(bench.good("status slide --missing").out, "1,3\n");
    assert_eq!(bench.good("status slide --missing --tasks 2").out, "1\n");
    bench.good(&format!("{make} --shard 1/2"));
    assert!(bench.good("status slide").out.contains("Close it with: papsynth slide finalize slide"));
    bench.good("slide finalize slide --verify");
    assert!(bench.good("status slide").out.ends_with("it is closed\n"));
    bench.good("verify slide");
    fs::write(bench.path("slide/other"), "x").unwrap();
    refused(&bench, "verify slide", "other: is no file of the slide");
    assert!(bench.good("clean slide --strays").out.contains("1 other removed"));
    bench.good("verify slide");
    fs::remove_file(bench.path("slide/slide.json")).unwrap();
    refused(&bench, "verify slide", "slide.json");
    bench.good(&make);
    bench.good("verify slide");
    fs::remove_file(bench.path("slide/slide.ome.zarr/0/c/0/1")).unwrap();
    refused(&bench, "verify slide", "is missing");
    bench.good(&format!("{make} --verify"));
    bench.good("verify slide");
    refused(&bench, &format!("{make} --seed 4"), "another seed");
    // As its card says.
    let card = fs::read_to_string(bench.path("slide/README.md")).unwrap();
    let said = card.split('`').find(|words| words.starts_with("papsynth slide make")).unwrap();
    let said = said.replace("recipe.toml", "slide/recipe.toml").replace("model.json", "slide/model.json");
    bench.good(said.strip_prefix("papsynth ").unwrap().replace("DIR", "again").as_str());
    assert_eq!(bench.files("slide"), bench.files("again"));
}
