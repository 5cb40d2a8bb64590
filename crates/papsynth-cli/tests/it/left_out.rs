//! Subcommands without their feature.

use crate::support::Bench;

#[test]
fn a_subcommand_without_its_feature_names_the_feature() {
    let bench = Bench::new("left-out");
    for (words, feature, is_here) in [
        ("calibrate --stack planes --step-um 0.5", "calibrate", cfg!(feature = "calibrate")),
        ("completions bash", "completions", cfg!(feature = "completions")),
        ("man --out pages", "completions", cfg!(feature = "completions")),
        ("judge real synthetic --out report --help", "judge", cfg!(feature = "judge")),
        ("match real --out mine.toml", "judge", cfg!(feature = "judge")),
        ("learn --class parabasal --out mine.json", "learn", cfg!(feature = "learn")),
        ("study real synthetic", "web", cfg!(feature = "web")),
        ("view fields --port 8080", "web", cfg!(feature = "web")),
        ("workbench --preset dense", "web", cfg!(feature = "web")),
    ] {
        if !is_here {
            let run = bench.run(words);
            assert!(run.code == 2 && run.err.contains(&format!("--features {feature}")), "{words}: {}", run.err);
        }
    }
}
