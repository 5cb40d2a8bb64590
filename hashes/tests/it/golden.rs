//! Compares the hashes of this machine with `fixtures/hashes.txt`. `PAPSYNTH_BLESS=1` rewrites the file.

use std::path::Path;
use std::process::Command;

/// Returns the differences, line by line.
fn differences(expected: &str, found: &str) -> Vec<String> {
    assert_eq!(expected.lines().count(), found.lines().count(), "the number of hashes differs");
    let pairs = expected.lines().zip(found.lines());
    pairs.filter(|(a, b)| a != b).map(|(a, b)| format!("expected {a}, found {b}")).collect()
}

#[test]
fn hashes_match_the_fixture() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/hashes.txt");
    let found = papsynth_hashes::lines().unwrap();
    if std::env::var_os("PAPSYNTH_BLESS").is_some() {
        std::fs::write(&file, &found).unwrap();
    }
    let expected = std::fs::read_to_string(&file).unwrap();
    let differences = differences(&expected, &found);
    assert!(differences.is_empty(), "{}", differences.join("\n"));

    // Disables instructions for which the C library has different sines; results must not change. Other C libraries
    // ignore the variable.
    let narrow = Command::new(env!("CARGO_BIN_EXE_papsynth-hashes"))
        .env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-FMA,-AVX2")
        .output()
        .unwrap();
    assert!(narrow.status.success(), "{}", String::from_utf8_lossy(&narrow.stderr));
    assert_eq!(String::from_utf8(narrow.stdout).unwrap(), found, "without FMA and AVX2 in the C library");
}
