//! `papsynth study`.

#[allow(dead_code, reason = "each test uses a part")]
use crate::support::Bench;

/// Folders of small images with dark squares on a bright background.
fn bench(name: &str) -> Bench {
    let bench = Bench::new(name);
    for (side, glass) in [("real", 200), ("synthetic", 230)] {
        std::fs::create_dir_all(bench.path(side)).unwrap();
        for k in 0..3 {
            bench.grey_png(&format!("{side}/{k}.png"), 240, 240, |x, y| {
                if (x + 11 * k) % 60 < 30 && (y + 7 * k) % 60 < 30 { glass / 2 } else { glass }
            });
        }
    }
    bench
}

const SMALL: &str = "--trials 4 --patch-px 64";

#[test]
fn invalid_input_of_a_study_has_exit_code_2() {
    let bench = bench("study-refused");
    for (words, named) in [
        ("study", "REAL"),
        ("study real", "SYNTHETIC"),
        ("study real missing", "missing"),
        ("study real real/0.png", "a folder of images"),
        ("study real synthetic --subject ../other", "subject: `../other`"),
        ("study real synthetic --subject x", "subject: `x`"),
        ("study real synthetic --trials 0", "trials: 0"),
        ("study real synthetic --exposure-ms 1", "exposure_ms: 1"),
        ("study real synthetic --noise nan", "noise_dn: NaN"),
        ("study real synthetic --pixel-um=-1", "expected 0.05 to 4 micrometres"),
        ("study real synthetic --design 3afc", "2afc"),
        ("study real synthetic --port 0", "--port"),
        ("study real synthetic --json", "cannot be used with"),
        ("study --json", "--results"),
        ("study real synthetic --patch-px 300", "real: found 0 of "),
        ("study real synthetic --trials 10000 --patch-px 64", "use more or larger fields"),
        ("study --results real", "contains no study"),
        ("study --results missing", "missing"),
        ("study real synthetic --results results", "cannot be used with"),
    ] {
        let run = bench.run(words);
        assert_eq!(run.code, 2, "{words}: {}", run.err);
        assert!(run.err.contains(named), "{words}: {}", run.err);
        assert!(!bench.path("results").exists(), "{words}");
    }
}

#[cfg(unix)]
#[test]
fn a_study_prints_its_address_and_continues_after_an_interrupt() {
    let bench = bench("study-interrupt");
    let first = bench.interrupt_after_first_line(&format!("study real synthetic {SMALL}"));
    assert_eq!(first.code, 130, "{}", first.err);
    assert!(first.out.contains("http://127.0.0.1:"), "{}", first.out);
    assert!(
        first.err.contains("real: found 3 of 25 fields") && first.err.contains("run the same command again"),
        "{}",
        first.err
    );
    let address = |text: &str| text.split_whitespace().find(|word| word.starts_with("http:")).map(str::to_owned);
    let second = bench.interrupt_after_first_line(&format!("study real synthetic {SMALL}"));
    assert_eq!(address(&first.out), address(&second.out), "an open page reconnects");
    let other = bench.run("study real synthetic --trials 6 --patch-px 64");
    assert_eq!(other.code, 2);
    assert!(other.err.contains("trials is 6, expected 4"), "{}", other.err);
    let pooled = bench.run("study --results results");
    assert_eq!(pooled.code, 2);
    assert!(pooled.err.contains("finished studies: 0 of 1"), "{}", pooled.err);
}
