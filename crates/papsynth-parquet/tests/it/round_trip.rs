//! What is written is read back, whatever the columns are.

use papsynth_parquet::{Column, Error, Kind, Limits, Reader, Value, Writer};
use proptest::collection::vec;
use proptest::prelude::*;

fn kind() -> impl Strategy<Value = Kind> {
    let leaf = prop_oneof![
        Just(Kind::Bool),
        Just(Kind::U32),
        Just(Kind::I64),
        Just(Kind::F64),
        Just(Kind::Text),
        Just(Kind::Bytes)
    ];
    leaf.prop_recursive(3, 12, 3, |inner| {
        let fields = vec((inner.clone(), any::<bool>()), 1..4).prop_map(|kinds| Kind::Struct(named(kinds)));
        prop_oneof![inner.prop_map(Kind::list), fields]
    })
}

fn named(kinds: Vec<(Kind, bool)>) -> Vec<Column> {
    let column = |(i, (kind, nullable))| Column { name: format!("c{i}"), kind, nullable };
    kinds.into_iter().enumerate().map(column).collect()
}

fn value(kind: &Kind) -> BoxedStrategy<Value> {
    match kind {
        Kind::Bool => any::<bool>().prop_map(Value::Bool).boxed(),
        Kind::U32 => any::<u32>().prop_map(Value::U32).boxed(),
        Kind::I64 => any::<i64>().prop_map(Value::I64).boxed(),
        Kind::F64 => any::<f64>().prop_map(Value::F64).boxed(),
        Kind::Text => "[a-c]{0,3}|.{0,8}".prop_map(Value::Text).boxed(),
        Kind::Bytes => vec(any::<u8>(), 0..9).prop_map(Value::Bytes).boxed(),
        Kind::List(kind) => {
            vec(prop_oneof![1 => Just(Value::Null), 4 => value(kind)], 0..4).prop_map(Value::List).boxed()
        }
        Kind::Struct(fields) => row(fields).prop_map(Value::Struct).boxed(),
    }
}

fn row(columns: &[Column]) -> BoxedStrategy<Vec<Value>> {
    let cell = |column: &Column| match column.nullable {
        true => prop_oneof![Just(Value::Null), value(&column.kind)].boxed(),
        false => value(&column.kind),
    };
    columns.iter().map(cell).collect::<Vec<_>>().boxed()
}

fn table() -> impl Strategy<Value = (Vec<Column>, Vec<Vec<Value>>)> {
    vec((kind(), any::<bool>()), 1..5).prop_map(named).prop_flat_map(|columns| {
        let rows = vec(row(&columns), 0..12);
        (Just(columns), rows)
    })
}

fn write(columns: &[Column], rows: &[Vec<Value>]) -> Vec<u8> {
    let mut writer = Writer::new(Vec::new(), columns, &[("a", "1"), ("b", "2")]).unwrap();
    rows.iter().for_each(|row| writer.row(row.clone()).unwrap());
    writer.finish().unwrap()
}

fn read(reader: &Reader, names: &[&str], rows: std::ops::Range<u64>) -> Vec<Vec<Value>> {
    reader.rows(names, rows).unwrap().collect::<Result<_, _>>().unwrap()
}

/// Numbers by their bits, so that what is no number equals itself.
fn shown(rows: &[Vec<Value>]) -> String {
    format!("{rows:?}")
}

proptest! {
    #[test]
    fn any_table_comes_back((columns, rows) in table(), from in 0_u64..14, length in 0_u64..14) {
        let bytes = write(&columns, &rows);
        prop_assert!(bytes == write(&columns, &rows));
        let reader = Reader::from_bytes(bytes, &Limits::default()).unwrap();
        prop_assert_eq!(reader.columns(), &columns[..]);
        prop_assert_eq!(reader.row_count(), rows.len() as u64);
        prop_assert_eq!(reader.metadata("b"), Some("2"));
        let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
        prop_assert_eq!(shown(&read(&reader, &names, 0..u64::MAX)), shown(&rows));
        // A part of it, its columns in another order.
        let back: Vec<&str> = names.iter().rev().copied().take(2).collect();
        let part = (0_u64..).zip(&rows).filter(|(n, _)| (from..from + length).contains(n)).map(|(_, row)| row);
        let part: Vec<Vec<Value>> = part.map(|row| row.iter().rev().take(2).cloned().collect()).collect();
        prop_assert_eq!(shown(&read(&reader, &back, from..from + length)), shown(&part));
    }
}

#[test]
fn long_tables_are_written_in_groups_and_read_from_any_row_on() {
    let columns = [Column::new("n", Kind::I64), Column::new("data", Kind::Bytes).or_null()];
    let data = |n: i64| (n % 3 > 0).then(|| vec![n.to_le_bytes()[0]; 1 << 20]);
    let mut writer = Writer::new(Vec::new(), &columns, &[]).unwrap();
    (0..70_i64).for_each(|n| writer.row(vec![n.into(), data(n).into()]).unwrap());
    let bytes = writer.finish().unwrap();
    let reader = Reader::from_bytes(bytes, &Limits::default()).unwrap();
    let rows = read(&reader, &["data", "n"], 40..69);
    assert!(rows == (40..69).map(|n| vec![data(n).into(), n.into()]).collect::<Vec<Vec<Value>>>());
    assert_eq!(read(&reader, &["n"], 69..99), [[69_i64.into()]]);
    // Small rows, too: 65 536 in a group.
    let rows: Vec<Vec<Value>> = (0..70_000_i64).map(|n| vec![n.into(), Value::Null]).collect();
    let reader = Reader::from_bytes(write(&columns, &rows), &Limits::default()).unwrap();
    assert!(read(&reader, &["n", "data"], 65_000..66_000) == rows[65_000..66_000]);
}

/// Keeps no more than it was told of at once.
#[test]
fn memory_is_bounded_by_a_group() {
    struct Counting(std::sync::Arc<std::sync::atomic::AtomicUsize>);
    impl std::io::Write for Counting {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.fetch_add(bytes.len(), std::sync::atomic::Ordering::Relaxed);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let written = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let columns = [Column::new("data", Kind::Bytes)];
    let mut writer = Writer::new(Counting(written.clone()), &columns, &[]).unwrap();
    for n in 1..=100_usize {
        writer.row(vec![vec![7_u8; 1 << 20].into()]).unwrap();
        let held = (n << 20) - written.load(std::sync::atomic::Ordering::Relaxed).min(n << 20);
        assert!(held <= 32 << 20, "{held} bytes are held after {n} rows");
    }
}

#[test]
fn a_row_that_does_not_fit_is_refused_and_left_out() {
    let columns = [Column::new("n", Kind::I64), Column::new("box", Kind::list(Kind::U32))];
    let mut writer = Writer::new(Vec::new(), &columns, &[]).unwrap();
    let list = || Value::List(vec![1_u32.into()]);
    for (row, what) in [
        (vec![1_i64.into()], "a row of 1 values in a table of 2 columns"),
        (vec![1_i64.into(), Value::Null], "column `box` has no room for nothing"),
        (vec![1_u32.into(), list()], "column `n` has no room for an integer of 32 bits"),
        (vec![1_i64.into(), Value::List(vec![1_i64.into()])], "column `box` has no room for an integer of 64 bits"),
        (vec![Value::List(vec![]), list()], "column `n` has no room for a list"),
    ] {
        let error = writer.row(row).unwrap_err();
        assert!(matches!(&error, Error::Table(message) if message == what), "{error}");
    }
    writer.row(vec![1_i64.into(), list()]).unwrap();
    let reader = Reader::from_bytes(writer.finish().unwrap(), &Limits::default()).unwrap();
    assert_eq!(reader.row_count(), 1);
    assert!(reader.rows(&["none"], 0..1).is_err());
    assert!(Writer::new(Vec::new(), &[], &[]).is_err());
    assert!(Writer::new(Vec::new(), &[Column::new("s", Kind::Struct(Vec::new()))], &[]).is_err());
}

#[test]
fn a_disk_that_is_full_is_no_broken_table() {
    struct Full;
    impl std::io::Write for Full {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(std::io::ErrorKind::StorageFull.into())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let columns = [Column::new("n", Kind::I64)];
    let made = Writer::new(Full, &columns, &[]).and_then(|mut writer| {
        writer.row(vec![1_i64.into()])?;
        writer.finish().map(|_| ())
    });
    assert!(matches!(made, Err(Error::Io(error)) if error.kind() == std::io::ErrorKind::StorageFull));
}
