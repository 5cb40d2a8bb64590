//! Fields in a folder: a papsynth data set, a folder of data sets, or a folder of images.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use papsynth_dataset::read::{image_files, natural_order};
use papsynth_dataset::{Dataset, FrameSummary, InputError, ShardRecord};

use crate::error::Error;

const MANIFEST: &str = "manifest.json";

/// Largest record, recipe or table that is read, bytes.
const MAX_TEXT_BYTES: u64 = 1 << 26;

#[derive(Debug, Clone)]
pub(crate) struct Field {
    /// Path relative to the given folder, with `/` between folders.
    pub(crate) name: String,
    /// Resolved path; it is inside that folder.
    pub(crate) path: PathBuf,
    /// The frame, if the field belongs to a papsynth data set.
    pub(crate) frame: Option<Frame>,
}

#[derive(Debug, Clone)]
pub(crate) struct Frame {
    pub(crate) root: PathBuf,
    pub(crate) summary: FrameSummary,
    /// Values of the recipe of the data set, by field name.
    pub(crate) recipe: Arc<BTreeMap<String, toml::Value>>,
}

/// A folder from which no file outside is read.
pub(crate) struct Root {
    /// The given path, for messages.
    pub(crate) given: PathBuf,
    /// The resolved path.
    real: PathBuf,
}

impl Root {
    pub(crate) fn new(folder: &Path) -> Result<Self, Error> {
        let real = fs::canonicalize(folder).map_err(Error::io("read", folder))?;
        if !real.is_dir() {
            return Err(Error::folder(folder, "expected a folder of images or a papsynth data set, found a file"));
        }
        Ok(Self { given: folder.to_owned(), real })
    }

    /// Resolves a path in the folder.
    ///
    /// # Errors
    /// If it is outside the folder.
    pub(crate) fn inside(&self, path: &Path) -> Result<PathBuf, Error> {
        let real = fs::canonicalize(path).map_err(Error::io("read", path))?;
        if real.starts_with(&self.real) {
            return Ok(real);
        }
        let given = self.given.display();
        Err(Error::folder(path, format!("links to a path outside {given}; expected a file in the folder")))
    }

    /// Returns all fields in the folder, in natural order of their names.
    pub(crate) fn fields(&self) -> Result<Vec<Field>, Error> {
        let mut fields = Vec::new();
        if self.real.join(MANIFEST).exists() {
            self.add_frames(&self.real, "", &mut fields)?;
        } else {
            let mut sets = entries(&self.given)?;
            sets.retain(|(_, path)| path.join(MANIFEST).exists());
            for (name, path) in &sets {
                self.add_frames(&self.inside(path)?, &format!("{name}/"), &mut fields)?;
            }
            if sets.is_empty() {
                self.add_images(&mut fields)?;
            }
        }
        match fields.is_empty() {
            true => Err(Error::folder(&self.given, "the data set has no complete frame; expected at least 1")),
            false => Ok(fields),
        }
    }

    fn add_images(&self, fields: &mut Vec<Field>) -> Result<(), Error> {
        let images = self.real.join("images");
        let (files, prefix) = match image_files(&self.real) {
            Err(papsynth_dataset::Error::Input { problem: InputError::NoImages, .. }) if images.is_dir() => {
                (image_files(&self.inside(&images)?)?, "images/")
            }
            files => (files?, ""),
        };
        let mut names: Vec<_> = files.into_iter().collect();
        names.sort_by(|(a, _), (b, _)| natural_order(a, b));
        for (_, path) in names {
            fields.push(Field { name: format!("{prefix}{}", name(&path)), path: self.inside(&path)?, frame: None });
        }
        Ok(())
    }

    /// Adds the complete frames of one data set.
    fn add_frames(&self, root: &Path, prefix: &str, fields: &mut Vec<Field>) -> Result<(), Error> {
        let mut records = entries(&root.join("shards"))?;
        records.retain(|(name, _)| name.strip_suffix(".json").is_some_and(|s| s.bytes().all(|b| b.is_ascii_digit())));
        let recipe = Arc::new(recipe(&self.text(&root.join("recipe.toml"))?));
        let mut is_checked = false;
        for (_, path) in records {
            let record = ShardRecord::from_json(self.text(&path)?.as_bytes())
                .map_err(|problem| papsynth_dataset::Error::Input { path: path.clone(), problem })?;
            // The breakdown by recipe values needs the recipe of the images.
            if !is_checked {
                Dataset::open(root)?.check_inputs()?;
                is_checked = true;
            }
            // Records list only paths inside the data set; symbolic links are checked here.
            for summary in record.frames {
                let stem = format!("images/{:06}.", summary.index);
                let Some(image) = record.files.iter().find(|file| file.path.starts_with(&stem)) else {
                    return Err(Error::folder(&path, "lists no image in the folder `images`"));
                };
                fields.push(Field {
                    name: format!("{prefix}{}", image.path),
                    path: self.inside(&root.join(&image.path))?,
                    frame: Some(Frame { root: root.to_owned(), summary, recipe: Arc::clone(&recipe) }),
                });
            }
        }
        Ok(())
    }

    pub(crate) fn text(&self, path: &Path) -> Result<String, Error> {
        let bytes = bytes(&self.inside(path)?, MAX_TEXT_BYTES)?;
        String::from_utf8(bytes).map_err(|_| Error::folder(path, "not valid UTF-8"))
    }
}

/// Returns names and paths of the entries of a folder, in natural order.
pub(crate) fn entries(folder: &Path) -> Result<Vec<(String, PathBuf)>, Error> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(Error::io("read", folder))? {
        let path = entry.map_err(Error::io("read", folder))?.path();
        found.push((name(&path), path));
    }
    found.sort_by(|(a, _), (b, _)| natural_order(a, b));
    Ok(found)
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Reads a file of at most `limit` bytes.
pub(crate) fn bytes(path: &Path, limit: u64) -> Result<Vec<u8>, Error> {
    let failed = Error::io("read", path);
    let mut bytes = Vec::new();
    // Opening a pipe could block forever.
    let read = path.metadata().and_then(|metadata| match metadata.is_file() {
        false => Err(io::Error::other("not a regular file")),
        true => File::open(path)?.take(limit.saturating_add(1)).read_to_end(&mut bytes),
    });
    let read = read.map_err(failed)? as u64;
    if read > limit {
        let problem = InputError::FileSize { bytes: read, limit };
        return Err(papsynth_dataset::Error::Input { path: path.to_owned(), problem }.into());
    }
    Ok(bytes)
}

/// Returns the values of a recipe by field name, such as `layout.count.uniform = [5.0, 11.0]`; empty if it is invalid,
/// because the breakdown is optional.
fn recipe(text: &str) -> BTreeMap<String, toml::Value> {
    fn add(prefix: &str, table: toml::Table, lines: &mut BTreeMap<String, toml::Value>) {
        for (key, value) in table {
            match value {
                toml::Value::Table(table) => add(&format!("{prefix}{key}."), table, lines),
                value => _ = lines.insert(format!("{prefix}{key}"), value),
            }
        }
    }
    let mut values = BTreeMap::new();
    add("", toml::from_str(text).unwrap_or_default(), &mut values);
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support::{Scratch, write_image};

    #[test]
    fn images_are_listed_in_natural_order() {
        let scratch = Scratch::new("fields");
        for name in ["f10.png", "f9.png", "f1.png", ".hidden.png"] {
            write_image(&scratch.join(name), 1, [64, 64]);
        }
        fs::write(scratch.join("notes.txt"), "not an image").unwrap();
        let fields = Root::new(&scratch).unwrap().fields().unwrap();
        assert_eq!(fields.iter().map(|f| f.name.as_str()).collect::<Vec<_>>(), ["f1.png", "f9.png", "f10.png"]);
        assert!(fields.iter().all(|f| f.frame.is_none()));
        // Images may be in a subfolder `images`.
        let below = Scratch::new("fields-images");
        write_image(&below.join("images/a.png"), 1, [64, 64]);
        assert_eq!(Root::new(&below).unwrap().fields().unwrap()[0].name, "images/a.png");
    }

    #[test]
    fn invalid_folders_are_refused() {
        let scratch = Scratch::new("no-fields");
        let error = |path: &Path| Root::new(path).and_then(|root| root.fields()).unwrap_err();
        assert!(error(&scratch.join("missing")).to_string().contains("missing"));
        assert!(!error(&scratch.join("missing")).is_io());
        error(&scratch);
        fs::write(scratch.join("file"), "").unwrap();
        assert!(error(&scratch.join("file")).to_string().contains("a folder of images"));
        fs::create_dir_all(scratch.join("set/shards")).unwrap();
        fs::write(scratch.join("set/manifest.json"), "{}").unwrap();
        fs::write(scratch.join("set/recipe.toml"), "").unwrap();
        assert!(error(&scratch.join("set")).to_string().contains("no complete frame"));
        fs::write(scratch.join("set/shards/000000.json"), "[1, 2").unwrap();
        assert!(error(&scratch.join("set")).to_string().contains("000000.json"));
    }

    #[cfg(unix)]
    #[test]
    fn links_out_of_the_folder_are_refused_and_links_within_are_not() {
        use std::os::unix::fs::symlink;
        let scratch = Scratch::new("links");
        let (folder, elsewhere) = (scratch.join("folder"), scratch.join("folder-elsewhere"));
        fs::create_dir_all(&folder).unwrap();
        fs::create_dir_all(&elsewhere).unwrap();
        write_image(&folder.join("a.png"), 1, [64, 64]);
        write_image(&elsewhere.join("secret.png"), 2, [64, 64]);
        symlink(folder.join("a.png"), folder.join("b.png")).unwrap();
        // The folder itself may be a symbolic link.
        symlink(&folder, scratch.join("link")).unwrap();
        assert_eq!(Root::new(&scratch.join("link")).unwrap().fields().unwrap().len(), 2);
        symlink(elsewhere.join("secret.png"), folder.join("c.png")).unwrap();
        let error = Root::new(&folder).unwrap().fields().unwrap_err();
        assert!(error.to_string().contains("c.png: links to a path outside"), "{error}");
        fs::remove_file(folder.join("c.png")).unwrap();
        // A data set outside the folder.
        fs::write(elsewhere.join(MANIFEST), "{}").unwrap();
        symlink(&elsewhere, folder.join("set")).unwrap();
        assert!(Root::new(&folder).unwrap().fields().unwrap_err().to_string().contains("outside"));
    }

    #[test]
    fn recipes_become_values_by_field_name() {
        let lines = recipe("version = 1\n[layout.count]\nuniform = [1.0, 2.0]\n[cells.a]\nsize = 1\n");
        let shown: Vec<_> = lines.iter().map(|(name, value)| format!("{name} = {value}")).collect();
        assert_eq!(shown, ["cells.a.size = 1", "layout.count.uniform = [1.0, 2.0]", "version = 1"]);
        assert!(recipe("not [ toml").is_empty());
    }
}
