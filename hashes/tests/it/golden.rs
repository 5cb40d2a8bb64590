//! The hashes of this machine are those of `fixtures/hashes.txt`, which `PAPSYNTH_BLESS=1` writes anew.

use std::path::Path;
use std::process::Command;

/// What differs, line by line.
fn differences(expected: &str, found: &str) -> Vec<String> {
    assert_eq!(expected.lines().count(), found.lines().count(), "another number of hashes");
    let pairs = expected.lines().zip(found.lines());
    pairs.filter(|(a, b)| a != b).map(|(a, b)| format!("{a}\nis {b} here")).collect()
}

#[test]
fn this_machine_finds_the_same() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/hashes.txt");
    let found = papsynth_hashes::lines().unwrap();
    if std::env::var_os("PAPSYNTH_BLESS").is_some() {
        std::fs::write(&file, &found).unwrap();
    }
    let expected = std::fs::read_to_string(&file).unwrap();
    let differences = differences(&expected, &found);
    assert!(differences.is_empty(), "{}", differences.join("\n"));

    // The C library without the instructions for which it has other sines: none of it may matter. Other libraries do not
    // know the variable.
    let narrow = Command::new(env!("CARGO_BIN_EXE_papsynth-hashes"))
        .env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-FMA,-AVX2")
        .output()
        .unwrap();
    assert!(narrow.status.success(), "{}", String::from_utf8_lossy(&narrow.stderr));
    assert_eq!(String::from_utf8(narrow.stdout).unwrap(), found, "with a lesser C library");
}
