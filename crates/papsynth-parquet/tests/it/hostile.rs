//! No file makes the reader panic, or take more memory than it has bytes to show for.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use papsynth_parquet::{Column, Error, Kind, Limits, Reader, Value, Writer};
use proptest::prelude::*;

/// Notes the largest single piece of memory that was asked for.
struct Noting;

static LARGEST: AtomicUsize = AtomicUsize::new(0);

#[expect(unsafe_code, reason = "an allocator is one; it hands everything on")]
unsafe impl GlobalAlloc for Noting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Noting = Noting;

const LIMITS: Limits =
    Limits { footer_bytes: 1 << 16, group_values: 1 << 12, column_bytes: 1 << 16, row_bytes: 1 << 16 };

/// Far more than a file of a few kilobytes needs within these limits, far less than what it can announce.
const MOST_BYTES: usize = 1 << 24;

fn file() -> Vec<u8> {
    let object = vec![Column::new("id", Kind::U32), Column::new("rle", Kind::Text).or_null()];
    let columns = [
        Column::new("n", Kind::I64),
        Column::new("flag", Kind::Bool).or_null(),
        Column::new("x", Kind::F64),
        Column::new("name", Kind::Text),
        Column::new("image", Kind::Struct(vec![Column::new("bytes", Kind::Bytes)])).or_null(),
        Column::new("objects", Kind::list(Kind::Struct(object))),
        Column::new("box", Kind::list(Kind::list(Kind::I64))).or_null(),
    ];
    let mut writer = Writer::new(Vec::new(), &columns, &[("huggingface", "{}")]).unwrap();
    for n in 0..40_i64 {
        let object = Value::Struct(vec![7_u32.into(), (n % 3 > 0).then_some("Ti9d5d0000000000").into()]);
        let objects = vec![object; usize::try_from(n % 4).unwrap()];
        let boxes: Option<Vec<Value>> = (n % 5 > 0).then(|| vec![vec![Value::I64(n); 3].into(); 2]);
        let image = Value::Struct(vec![vec![0_u8; 30].into()]);
        let name = ["superficial", "parabasal"][usize::from(n % 2 == 0)];
        let cells = [n.into(), true.into(), 0.5.into(), name.into(), image, objects.into(), boxes.into()];
        writer.row(cells.to_vec()).unwrap();
    }
    writer.finish().unwrap()
}

/// Reads all there is, and says whether it could.
fn look(bytes: &[u8]) -> Result<usize, Error> {
    let reader = Reader::from_bytes(bytes, &LIMITS)?;
    let names: Vec<&str> = reader.columns().iter().map(|column| column.name.as_str()).collect();
    let rows = reader.rows(&names, 0..u64::MAX)?.collect::<Result<Vec<_>, _>>()?;
    // The end of it, too, which passes over what is before.
    reader.rows(&names, 20..u64::MAX)?.collect::<Result<Vec<_>, _>>()?;
    Ok(rows.len())
}

fn is_harmless(bytes: &[u8]) {
    let _ = look(bytes);
    let largest = LARGEST.load(Ordering::Relaxed);
    assert!(largest < MOST_BYTES, "{largest} bytes at once");
}

#[test]
fn every_byte_may_be_another() {
    let file = file();
    assert_eq!(look(&file).unwrap(), 40);
    for at in 0..file.len() {
        for value in [0, 1, 0x7f, 0x80, 0xff, file[at] ^ 1, file[at] ^ 0x10] {
            let mut changed = file.clone();
            changed[at] = value;
            is_harmless(&changed);
        }
    }
}

#[test]
fn a_file_may_end_anywhere() {
    let file = file();
    for end in 0..file.len() {
        assert!(look(&file[..end]).is_err(), "{end} of {}", file.len());
        assert!(look(&file[end + 1..]).is_err());
    }
    is_harmless(&[]);
}

#[test]
fn limits_hold() {
    let file = file();
    for (limits, what) in [
        (Limits { footer_bytes: 100, ..LIMITS }, "footer"),
        (Limits { group_values: 39, ..LIMITS }, "more rows than are read"),
        (Limits { group_values: 41, ..LIMITS }, "more values than are read"),
        (Limits { column_bytes: 1000, ..LIMITS }, "longer"),
        (Limits { row_bytes: 29, ..LIMITS }, "more bytes than are read"),
        (Limits { row_bytes: 150, ..LIMITS }, "more values than are read"),
    ] {
        let read = Reader::from_bytes(file.clone(), &limits).and_then(|reader| {
            reader.rows(&["image", "objects", "box"], 0..40)?.collect::<Result<Vec<_>, _>>().map(|rows| rows.len())
        });
        let error = read.unwrap_err().to_string();
        assert!(error.contains(what), "{limits:?}: {error}");
    }
}

proptest! {
    #[test]
    fn pieces_may_be_anything(at in 0.0..1.0, with in proptest::collection::vec(any::<u8>(), 1..12), cut in 0_usize..12) {
        let file = file();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a fraction of its length")]
        let at = (at * file.len() as f64) as usize;
        let end = (at + cut).min(file.len());
        is_harmless(&[&file[..at], &with, &file[end..]].concat());
    }

    #[test]
    fn a_footer_may_be_anything(footer in proptest::collection::vec(any::<u8>(), 0..200)) {
        let length = u32::try_from(footer.len()).unwrap().to_le_bytes();
        is_harmless(&[b"PAR1", footer.as_slice(), &length, b"PAR1"].concat());
    }
}
