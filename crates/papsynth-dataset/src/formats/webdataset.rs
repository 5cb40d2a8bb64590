//! `webdataset`: tar files of many frames. The files of a frame are consecutive and have the same name up to the first
//! dot: `json` (ground truth as COCO, and splits), `png` or, for a stack, `ome.tif` and `all-in-focus.png` (8 bits),
//! `cytoplasm.png` and `nucleus.png` (labels of 16 bits).

use std::cell::RefCell;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Cursor, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use papsynth::Plane;
use papsynth::truth::Group;
use serde_json::Value;

use super::depth::{Depth, to_training};
use super::flat;
use super::names::numbered;
use super::ome::{Levels, description, label_tiff, page};
use super::sink::{Field, Files, Sink};
use super::written::{LIMITS, Written, is_described};
use crate::bytes::json;
use crate::error::{Error, InputError};
use crate::files::{Folder, Handle, Pending};
use crate::truth::{FrameSummary, Split};
use crate::write::{PageWriter, label_png};

pub(super) struct Shard {
    tar: tar::Builder<BufWriter<Handle>>,
    pending: Pending,
    /// The planes of a stack in memory, because a tar header has the size of the file.
    stack: Option<(PageWriter<'static>, Memory)>,
}

/// A file in memory, shared with the encoder that writes it.
#[derive(Debug, Clone, Default)]
struct Memory(Rc<RefCell<Cursor<Vec<u8>>>>);

impl Write for Memory {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Memory {
    fn seek(&mut self, position: SeekFrom) -> io::Result<u64> {
        self.0.borrow_mut().seek(position)
    }
}

impl Shard {
    pub(super) fn new(files: &Files) -> Result<Self, Error> {
        let pending = files.folder.pending(&tar(files.shard))?;
        let tar = tar::Builder::new(BufWriter::with_capacity(1 << 18, pending.handle()?));
        Ok(Self { tar, pending, stack: None })
    }

    /// Adds a file. The header has its name and size; the time is 0, so that equal frames give equal bytes.
    fn add(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        let mut header = tar::Header::new_ustar();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        header.set_mtime(0);
        self.tar.append_data(&mut header, name, bytes).map_err(Error::io("write", self.pending.path()))
    }
}

pub(crate) fn tar(shard: u64) -> String {
    format!("webdataset/{shard:06}.tar")
}

pub(super) fn image(shard: u64, frame: &FrameSummary) -> String {
    format!("{}/{:06}.{}", tar(shard), frame.index, if frame.is_stack() { "ome.tif" } else { "png" })
}

pub(super) fn all_in_focus(shard: u64, index: u64) -> String {
    format!("{}/{index:06}.all-in-focus.png", tar(shard))
}

fn head(field: &Field) -> Value {
    let split = serde_json::json!({
        "field": Split::of_field(field.seed, field.frame.index).name(),
        "slide": field.split().name(),
    });
    serde_json::json!({ "frame": field.frame, "split": split, "truth": field.document })
}

pub(crate) struct TarFile {
    path: PathBuf,
    archive: tar::Archive<BufReader<File>>,
}

impl TarFile {
    pub(crate) fn open(folder: &Folder, name: &str) -> Result<Self, Error> {
        let path = folder.inside(name)?;
        let file = File::open(&path).map_err(|e| match e.kind() {
            ErrorKind::NotFound => Error::input(&path)(InputError::Missing("file")),
            _ => Error::io("read", &path)(e),
        })?;
        Ok(Self { path, archive: tar::Archive::new(BufReader::new(file)) })
    }

    pub(crate) fn files(&mut self) -> Result<Tar<'_>, Error> {
        let entries = self.archive.entries().map_err(read_error(&self.path))?;
        Ok(Tar { path: &self.path, entries })
    }

    pub(crate) fn content(&mut self, name: &str) -> Result<Vec<u8>, Error> {
        let mut files = self.files()?;
        while let Some(entry) = files.entry()? {
            if *entry.path_bytes() == *name.as_bytes() {
                return files.bytes(entry);
            }
        }
        Err(Error::input(files.path)(InputError::broken("tar", format!("the archive has no file `{name}`"))))
    }
}

pub(crate) struct Tar<'a> {
    path: &'a Path,
    entries: tar::Entries<'a, BufReader<File>>,
}

type Entry<'a> = tar::Entry<'a, BufReader<File>>;

impl<'a> Tar<'a> {
    fn entry(&mut self) -> Result<Option<Entry<'a>>, Error> {
        self.entries.next().transpose().map_err(read_error(self.path))
    }

    fn bytes(&self, entry: Entry) -> Result<Vec<u8>, Error> {
        let mut bytes = Vec::new();
        entry.take(LIMITS.max_file_bytes).read_to_end(&mut bytes).map_err(read_error(self.path))?;
        Ok(bytes)
    }

    fn next(&mut self) -> Result<Option<(String, Vec<u8>)>, Error> {
        let Some(entry) = self.entry()? else { return Ok(None) };
        let name = String::from_utf8_lossy(&entry.path_bytes()).into_owned();
        Ok(Some((name, self.bytes(entry)?)))
    }

    pub(crate) fn end(&mut self) -> Result<(), Error> {
        match self.next()? {
            None => Ok(()),
            Some((name, _)) => {
                let what = format!("unexpected file `{}` after the last frame", name.escape_default());
                Err(Error::input(self.path)(InputError::unfit(what)))
            }
        }
    }
}

/// Converts errors of the tar reader: invalid content is an error of the input, everything else of the system.
fn read_error(path: &Path) -> impl Fn(io::Error) -> Error {
    move |e| match e.kind() {
        io::ErrorKind::Other | io::ErrorKind::InvalidData | io::ErrorKind::UnexpectedEof => {
            Error::input(path)(InputError::broken("tar", e))
        }
        _ => Error::io("read", path)(e),
    }
}

pub(super) fn check(written: &Written, tar: &mut Tar) -> Result<(), Error> {
    let (field, key) = (written.field, numbered(written.field.frame.index));
    let images: &[&str] = if field.frame.is_stack() { &["ome.tif", "all-in-focus.png"] } else { &["png"] };
    for part in ["json"].iter().chain(images).copied().chain(flat::GROUPS.map(Group::name)) {
        let (name, bytes) = tar.next()?.unwrap_or_default();
        let path = tar.path.join(&name);
        let ending = name.strip_prefix(&format!("{key}.")).unwrap_or_default();
        let group = flat::GROUPS.into_iter().find(|group| group.name() == part);
        let checked = match (part, group) {
            (_, Some(group)) if [".png", ".tif"].iter().any(|end| ending == format!("{part}{end}")) => {
                written.labels(&bytes, written.flat(group))
            }
            ("json", _) if ending == part => {
                let found = serde_json::from_slice::<Value>(&bytes).map_err(InputError::from);
                let same = found.map(|found| found == head(field));
                same.and_then(|same| InputError::unless(same, "the content differs from the record and coco.json"))
            }
            ("ome.tif", _) if ending == part => written
                .planes(&bytes, Depth::Training)
                .and_then(|()| is_described(&bytes, &description(&field.frame.for_training()))),
            (_, None) if ending == part => written.image(&bytes, Depth::Training),
            _ => {
                let what = format!("found `{}`; expected {key}.{part}", name.escape_default());
                return Err(Error::input(tar.path)(InputError::unfit(what)));
            }
        };
        checked.map_err(Error::input(&path))?;
    }
    Ok(())
}

impl Sink for Shard {
    fn begin(&mut self, frame: &FrameSummary, _: &Files) -> Result<(), Error> {
        self.stack = None;
        if frame.is_stack() {
            let (memory, bytes) = (Memory::default(), frame.values() as u64 * frame.planes_um.len() as u64);
            let writer = PageWriter::new(memory.clone(), bytes).map_err(Error::io("encode", self.pending.path()))?;
            self.stack = Some((writer, memory));
        }
        Ok(())
    }

    fn plane(&mut self, plane: &Plane, frame: &FrameSummary, _: &Files) -> Result<(), Error> {
        let Some((writer, _)) = &mut self.stack else { return Ok(()) };
        let levels = to_training(&plane.grey, frame.bits);
        let frame = &frame.for_training();
        let text = (plane.index == 0).then(|| description(frame));
        let written = writer.write(Levels::new(&levels, frame).pixels(), &page(frame, text.as_deref()));
        written.map_err(Error::io("encode", self.pending.path()))
    }

    fn field(&mut self, field: &Field, files: &mut Files) -> Result<(), Error> {
        let key = numbered(field.frame.index);
        let failed = |path| Error::io("encode", path);
        let path = self.pending.path().to_owned();
        self.add(&format!("{key}.json"), &json(&head(field)))?;
        match self.stack.take() {
            None => self.add(&format!("{key}.png"), field.png(Depth::Training).map_err(failed(&path))?)?,
            Some((_, memory)) => {
                self.add(&format!("{key}.ome.tif"), memory.0.borrow().get_ref())?;
                self.add(&format!("{key}.all-in-focus.png"), field.png(Depth::Training).map_err(failed(&path))?)?;
            }
        }
        for group in flat::GROUPS {
            let labels = files.layout.flatten.labels(field.truth, group);
            let (ending, bytes) = match labels.fits_16_bits() {
                true => ("png", label_png(&labels, field.frame.pixel_um)),
                false => ("tif", label_tiff(labels, field.frame)),
            };
            self.add(&format!("{key}.{}.{ending}", group.name()), &bytes.map_err(failed(&path))?)?;
        }
        Ok(())
    }

    fn close(self: Box<Self>, files: &mut Files) -> Result<(), Error> {
        let Self { tar, pending, .. } = *self;
        let mut writer = tar.into_inner().map_err(Error::io("write", pending.path()))?;
        writer.flush().map_err(Error::io("write", pending.path()))?;
        drop(writer);
        files.written.push(pending.commit()?);
        Ok(())
    }
}
