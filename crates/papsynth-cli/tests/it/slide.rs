//! `papsynth slide`.

#[allow(dead_code, reason = "each test uses a part")]
use std::fs;

use crate::support::Bench;

/// Small frames and a deposit near the corner, for a fast tile.
const SMALL: &str = "--preset sparse --set scan.frame_px=256 --set scan.deposit.x_um=80 --set scan.deposit.y_um=80";

fn rejected(bench: &Bench, words: &str, why: &str) {
    let run = bench.run(words);
    assert!(run.code == 2 && (run.err.contains(why) || run.out.contains(why)), "{words}: {} {}", run.out, run.err);
}

#[test]
fn a_region_of_a_slide_is_written() {
    let bench = Bench::new("slide-tile");
    let tile = |name: &str, at: &str| {
        bench.good(&format!("slide tile {SMALL} --at {at} --size 200,150 --out {name}"));
        fs::read(bench.path(name)).unwrap()
    };
    let one = tile("one.png", "300,200");
    assert!(one == tile("again.png", "300,200"));
    assert!(one != tile("other.png", "301,200"));
    rejected(&bench, "slide tile --at 55999,0 --size 100,100 --out no.png", "56000 x 56000");
    rejected(&bench, "slide tile --at 0,0 --size 99999,99999 --out no.png", "more than 268435456 pixels");
    rejected(&bench, "slide tile --at 0 --out no.png", "two integers");
    rejected(&bench, "slide tile --at 0,0 --out no.png --set scan.frame_px=9", "scan.frame_px");
    rejected(&bench, "slide tile --at 0,0 --out no.png --set layout.kind=band", "layout.kind");
    rejected(&bench, "slide tile --at 0,0 --out no.png --set optics.imaging=abbe", "optics.imaging");
    rejected(
        &bench,
        "slide tile --at 27000,27000 --out no.png --set scan.max_object_radius_um=20",
        "scan.max_object_radius_um",
    );
    rejected(&bench, "slide tile --at 0,0 --size 20,20 --out no.jpg", "ends in .png");
    let planes = bench.good(&format!("slide tile {SMALL} --at 0,0 --size 20,20 --out planes.png --set focus.planes=3"));
    assert!(planes.err.contains("the centre plane of 3"), "{}", planes.err);
    fs::create_dir(bench.path("folder.png")).unwrap();
    rejected(&bench, "slide tile --at 0,0 --size 20,20 --out folder.png", "folder.png");
    assert!(!bench.path("no.png").exists());
}

#[test]
#[cfg(not(feature = "zarr"))]
fn a_build_without_zarr_names_the_feature() {
    let bench = Bench::new("slide-lean");
    rejected(&bench, "slide make --out slide", "--features zarr");
    assert!(!bench.path("slide").exists());
}

#[test]
#[cfg(feature = "zarr")]
fn a_slide_of_several_tasks_is_finalized_and_verified() {
    let bench = Bench::new("slide-make");
    let make = format!("slide make {SMALL} --out slide --size 900,600 --shard-px 512");
    rejected(&bench, &format!("{make} --max-memory 20MB"), "may be used");
    rejected(&bench, &format!("{make} --set scan.max_object_radius_um=20"), "scan.max_object_radius_um");
    assert!(!bench.path("slide").exists());
    // The number of threads and the memory limit do not change the files.
    bench.good(&format!("{make} --threads 8 --max-memory 300MiB"));
    bench.good(&format!("slide make {SMALL} --out other --size 900,600 --shard-px 512 --threads 1"));
    assert_eq!(bench.files("slide"), bench.files("other"));
    fs::remove_dir_all(bench.path("slide")).unwrap();
    bench.good(&format!("{make} --task 0/2"));
    rejected(&bench, "slide finalize slide", "missing or damaged shards: 2 of 4");
    assert_eq!(bench.good("status slide --missing").out, "1,3\n");
    assert_eq!(bench.good("status slide --missing --tasks 2").out, "1\n");
    bench.good(&format!("{make} --task 1/2"));
    assert!(bench.good("status slide").out.contains("papsynth slide finalize slide"));
    bench.good("slide finalize slide --verify");
    assert!(bench.good("status slide").out.ends_with("finished\n"));
    bench.good("verify slide");
    fs::write(bench.path("slide/other"), "x").unwrap();
    rejected(&bench, "verify slide", "other: untracked: does not belong to the slide");
    assert!(bench.good("clean slide --untracked").out.contains("1 untracked file"));
    bench.good("verify slide");
    fs::remove_file(bench.path("slide/slide.json")).unwrap();
    rejected(&bench, "verify slide", "slide.json");
    bench.good(&make);
    bench.good("verify slide");
    fs::remove_file(bench.path("slide/slide.ome.zarr/0/c/0/1")).unwrap();
    rejected(&bench, "verify slide", ": missing");
    bench.good(&format!("{make} --verify"));
    bench.good("verify slide");
    rejected(&bench, &format!("{make} --seed 4"), "another seed");
    // The card states the command of the slide.
    let card = fs::read_to_string(bench.path("slide/README.md")).unwrap();
    let command = card.split('`').find(|words| words.starts_with("papsynth slide make")).unwrap();
    let command = command.replace("recipe.toml", "slide/recipe.toml").replace("model.json", "slide/model.json");
    bench.good(command.strip_prefix("papsynth ").unwrap().replace("DIR", "again").as_str());
    assert_eq!(bench.files("slide"), bench.files("again"));
}
