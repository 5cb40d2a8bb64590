//! `webdataset`: tar files of many frames. The files of a frame are consecutive and have the same name up to the first
//! dot: `json` (ground truth as COCO, and splits), `png` or, for a stack, `ome.tif` and `all-in-focus.png` (8 bits),
//! `cytoplasm.png` and `nucleus.png` (labels of 16 bits).

use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read};
use std::path::{Path, PathBuf};

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
use crate::files::{Folder, Output};
use crate::truth::{FrameSummary, Split};
use crate::write::{PlainPages, label_png};

pub(super) struct Shard {
    tar: tar::Builder<Output>,
    path: PathBuf,
    /// The planes of a stack in memory, because a tar header has the size of the file.
    stack: Option<PlainPages<Vec<u8>>>,
}

impl Shard {
    pub(super) fn new(files: &Files) -> Result<Self, Error> {
        let output = Output::new(files.folder.pending(&tar(files.shard))?)?;
        Ok(Self { path: output.path().to_owned(), tar: tar::Builder::new(output), stack: None })
    }

    /// Adds a file. The header has its name and size; the time is 0, so that equal frames give equal bytes.
    fn add(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        let mut header = tar::Header::new_ustar();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        header.set_mtime(0);
        self.tar.append_data(&mut header, name, bytes).map_err(Error::io("write", &self.path))
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
        let planes = frame.planes_um.len();
        let pages = || PlainPages::new(Vec::new(), planes, (frame.values() * planes) as u64);
        self.stack = frame.is_stack().then(pages).transpose().map_err(Error::io("encode", &self.path))?;
        Ok(())
    }

    fn plane(&mut self, plane: &Plane, frame: &FrameSummary, _: &Files) -> Result<(), Error> {
        let Some(pages) = &mut self.stack else { return Ok(()) };
        let levels = to_training(&plane.grey, frame.bits);
        let frame = &frame.for_training();
        let text = (plane.index == 0).then(|| description(frame));
        let written = pages.write(Levels::new(&levels, frame).pixels(), &page(frame, text.as_deref()));
        written.map_err(Error::io("encode", &self.path))
    }

    fn field(&mut self, field: &Field, files: &mut Files) -> Result<(), Error> {
        let key = numbered(field.frame.index);
        let failed = |path| Error::io("encode", path);
        let path = self.path.clone();
        self.add(&format!("{key}.json"), &json(&head(field)))?;
        match self.stack.take() {
            None => self.add(&format!("{key}.png"), field.png(Depth::Training).map_err(failed(&path))?)?,
            Some(pages) => {
                self.add(&format!("{key}.ome.tif"), &pages.into_inner())?;
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
        let output = self.tar.into_inner().map_err(Error::io("write", &self.path))?;
        files.written.push(output.commit()?);
        Ok(())
    }
}
