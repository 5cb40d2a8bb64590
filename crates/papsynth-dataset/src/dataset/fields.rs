//! Fields to measure: data sets, and folders of images.

use std::path::Path;

use papsynth::truth::Group;
use papsynth::white_level as white;

use super::set::{Dataset, recorded_shards};
use crate::error::Error;
use crate::files::Check;
use crate::formats::{Format, names};
use crate::read::{FieldFile, NucleiFile, files_in};
use crate::truth::Form;

/// The fields in a folder, in the order of their names: a data set of ours with its masks of nuclei; or images (in the folder,
/// or in `images`), with masks of the same names in `masks` (labels, or anything above 0), or for each image
/// a table `NAME.csv` of `y,x` points beside it, and `frames.csv` that says which group each belongs to.
///
/// # Errors
/// If there is no image, the folder cannot be read, or its tables make no sense.
pub fn field_files(folder: &Path) -> Result<Vec<FieldFile>, Error> {
    if folder.join(names::MANIFEST).exists() { of_dataset(folder) } else { files_in(folder) }
}

/// The frames of a data set, which must all be whole; of a stack, its image with everything in focus.
fn of_dataset(path: &Path) -> Result<Vec<FieldFile>, Error> {
    let dataset = Dataset::open(path)?;
    let Dataset { folder, layout, .. } = &dataset;
    if !layout.has(Format::Folder) {
        let message =
            format!("the data set lies in files as {layout}; images and labels are read from the format `folder`");
        return Err(Error::folder(path, message));
    }
    let mut fields = Vec::new();
    for shard in recorded_shards(folder)? {
        let record = dataset.whole_or_flaw(shard, Check::Sizes)?.map_err(|flaw| {
            let message =
                format!("shard {shard} is not whole: {flaw}; `papsynth generate` with its recipe makes it again");
            Error::folder(path, message)
        })?;
        for frame in record.frames {
            let index = frame.index;
            let image = match Form::of(frame.planes_um.len()) {
                Form::Single => names::image(index, Form::Single),
                Form::Stack => names::all_in_focus(index),
            };
            fields.push(FieldFile {
                name: names::numbered(index),
                group: String::new(),
                pixel_um: Some(frame.pixel_um),
                slide: Some(frame.slide),
                image: folder.inside(&image)?,
                nuclei: NucleiFile::Labels(folder.inside(&names::labels(Group::Nucleus, index))?),
                white: Some(white(frame.bits)),
            });
        }
    }
    match fields.is_empty() {
        true => Err(Error::folder(path, "the data set has no whole frame")),
        false => Ok(fields),
    }
}
