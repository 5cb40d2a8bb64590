//! Users' files are read, or refused with an error that gives the cause.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the numbers are small")]

use crate::support;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use crate::support::Scratch;
use papsynth::recipe::{Labels, Layout, Recipe};
use papsynth::truth::LabelMap;
use papsynth_dataset::read::{
    GreyImage, LevelImage, Limits, NucleusSample, Stack, components, image_files, label_map, outlines, read_inputs,
    read_label_map, read_nuclei, read_outlines,
};
use papsynth_dataset::{Error, InputError};
use png::{BitDepth, ColorType};
use proptest::prelude::*;
use tiff::encoder::{Compression, TiffEncoder, colortype};

fn png(bytes: &[u8], size: [u32; 2], color: ColorType, depth: BitDepth) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, size[0], size[1]);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if color == ColorType::Indexed {
        encoder.set_palette(vec![9, 9, 9, 200, 0, 0, 0, 200, 0]);
    }
    encoder.write_header().unwrap().write_image_data(bytes).unwrap();
    out
}

fn grey_png(bytes: &[u8], width: u32) -> Vec<u8> {
    png(bytes, [width, bytes.len() as u32 / width], ColorType::Grayscale, BitDepth::Eight)
}

fn tiff<C: colortype::ColorType>(data: &[C::Inner], size: [u32; 2], pages: usize) -> Vec<u8>
where
    [C::Inner]: tiff::encoder::TiffValue,
{
    let mut out = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut out).unwrap().with_compression(Compression::Lzw);
    for _ in 0..pages {
        encoder.write_image::<C>(size[0], size[1], data).unwrap();
    }
    out.into_inner()
}

fn grey(bytes: &[u8]) -> Result<GreyImage, InputError> {
    GreyImage::decode(bytes, &Limits::default())
}

fn labels(bytes: &[u8]) -> Result<LabelMap, InputError> {
    label_map(bytes, &Limits::default())
}

fn map(width: usize, ids: &[u32]) -> LabelMap {
    LabelMap { width, ids: ids.to_vec() }
}

#[test]
fn grey_images_of_every_depth_are_read() {
    let image = grey(&grey_png(&[0, 7, 255, 9, 8, 1], 3)).unwrap();
    assert_eq!((image.width, image.height(), image.white), (3, 2, 255));
    assert_eq!(image.grey, [0, 7, 255, 9, 8, 1]);
    assert_eq!(image.fractions()[..3], [0.0, 7.0 / 255.0, 1.0]);
    let deep = png(&[1, 2, 255, 255], [2, 1], ColorType::Grayscale, BitDepth::Sixteen);
    assert_eq!(grey(&deep).unwrap(), GreyImage { width: 2, grey: vec![258, 65_535], white: 65_535 });
    let shallow = png(&[0b1010_0000, 0b0110_0000], [3, 2], ColorType::Grayscale, BitDepth::One);
    assert_eq!(grey(&shallow).unwrap().grey, [255, 0, 255, 0, 255, 255]);
    assert_eq!(labels(&shallow).unwrap(), map(3, &[1, 0, 1, 0, 1, 1]));
    assert_eq!(grey(&tiff::<colortype::Gray8>(&[3, 4], [2, 1], 1)).unwrap().grey, [3, 4]);
    assert_eq!(grey(&tiff::<colortype::Gray16>(&[3, 4000], [1, 2], 1)).unwrap().grey, [3, 4000]);
    assert_eq!(labels(&tiff::<colortype::Gray32>(&[3, 70_000], [1, 2], 1)).unwrap(), map(1, &[3, 70_000]));
}

#[test]
fn colour_images_are_refused_unless_all_pixels_are_grey() {
    let rgb = |bytes: &[u8]| png(bytes, [2, 1], ColorType::Rgb, BitDepth::Eight);
    assert_eq!(grey(&rgb(&[5, 5, 5, 6, 6, 6])).unwrap().grey, [5, 6]);
    assert_eq!(grey(&rgb(&[5, 5, 5, 6, 7, 6])), Err(InputError::NotGrey { what: "coloured", x: 1, y: 0 }));
    let alpha = |bytes: &[u8]| png(bytes, [1, 2], ColorType::GrayscaleAlpha, BitDepth::Eight);
    assert_eq!(grey(&alpha(&[5, 255, 6, 255])).unwrap().grey, [5, 6]);
    assert_eq!(grey(&alpha(&[5, 255, 6, 254])), Err(InputError::NotGrey { what: "transparent", x: 0, y: 1 }));
    let palette = png(&[0b0001_1000], [3, 1], ColorType::Indexed, BitDepth::Two);
    assert_eq!(grey(&palette), Err(InputError::NotGrey { what: "coloured", x: 1, y: 0 }));
    assert_eq!(labels(&palette).unwrap(), map(3, &[0, 1, 2]));
    let colours = tiff::<colortype::RGB8>(&[1, 1, 1, 1, 2, 1], [2, 1], 1);
    assert_eq!(grey(&colours), Err(InputError::NotGrey { what: "coloured", x: 1, y: 0 }));
}

#[test]
fn errors_give_the_cause() {
    let says = |bytes: &[u8], what: &str| {
        let problem = grey(bytes).unwrap_err().to_string();
        assert!(problem.contains(what), "{problem}");
    };
    says(b"GIF89a", "not a PNG, JPEG or TIFF");
    says(b"", "not a PNG, JPEG or TIFF");
    says(b"\x89PN", "PNG file is truncated");
    says(&tiff::<colortype::Gray32Float>(&[1.0], [1, 1], 1), "floating-point");
    says(&tiff::<colortype::Gray32>(&[1], [1, 1], 1), "32 bit samples");
    says(&tiff::<colortype::GrayI16>(&[-1], [1, 1], 1), "signed");
    says(&tiff::<colortype::Gray8>(&[1], [1, 1], 2), "several images");
    // The stated size is checked before the image is decoded.
    let mut vast = grey_png(&[0; 4], 2);
    vast[16..24].copy_from_slice(&[0, 0, 0x7f, 0xff, 0, 0, 0x7f, 0xff]);
    let crc = crc(&vast[12..29]);
    vast[29..33].copy_from_slice(&crc.to_be_bytes());
    says(&vast, "the image is 32767 x 32767 pixels; expected");
    let mut wide = tiff::<colortype::Gray8>(&[0; 4], [2, 2], 1);
    let at = wide.windows(4).position(|w| w == [0, 1, 4, 0]).unwrap() + 8;
    wide[at..at + 4].copy_from_slice(&4_000_000_u32.to_le_bytes());
    says(&wide, "the image is 4000000 x 2");
}

/// CRC-32 of a PNG chunk.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { 0xEDB8_8320 ^ (c >> 1) } else { c >> 1 })
    })
}

#[test]
fn truncated_files_are_refused() {
    let pixels: Vec<u8> = (0..=255).collect();
    let wide: Vec<u16> = (0..256).map(|i| i * 257).collect();
    for (kind, bytes) in [
        ("PNG", grey_png(&pixels, 16)),
        ("TIFF", tiff::<colortype::Gray8>(&pixels, [16, 16], 1)),
        ("TIFF", tiff::<colortype::Gray16>(&wide, [16, 16], 1)),
    ] {
        assert!(grey(&bytes).is_ok());
        for length in 0..bytes.len() {
            let read = grey(&bytes[..length]);
            assert!(read.is_err(), "{kind} of {length} of {} bytes", bytes.len());
        }
    }
}

/// A file of the corpus of the fuzz targets, written by Pillow or tifffile.
fn corpus(name: &str) -> Vec<u8> {
    fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/image").join(name)).unwrap()
}

/// The images that `jpeg-*` encode, of 40 x 24 pixels.
fn ramps(channels: usize) -> Vec<u16> {
    let pixels = (0..24_u16).flat_map(|y| (0..40).map(move |x| [60 + 3 * x + 2 * y, 200 - 2 * x, 40 + 4 * y]));
    pixels.flat_map(|pixel| pixel[..channels].to_vec()).collect()
}

#[test]
fn jpeg_files_are_read_alone_and_in_tiff() {
    for (name, channels, tolerance) in [
        ("jpeg-grey.jpg", 1, 2),
        ("jpeg-progressive.jpg", 1, 2),
        ("jpeg-colour.jpg", 3, 8),
        ("jpeg-grey.tif", 1, 2),
        ("jpeg-colour.tif", 3, 3),
        ("jpeg-ycbcr.tif", 3, 40),
    ] {
        let bytes = corpus(name);
        let image = LevelImage::decode(&bytes, &Limits::default()).unwrap();
        let is_grey = image.levels.chunks(3).all(|pixel| pixel.iter().all(|v| *v == pixel[0]));
        let found = if name == "jpeg-progressive.jpg" && image.channels == 3 {
            assert!(is_grey);
            image.levels.iter().step_by(3).copied().collect()
        } else {
            image.levels.clone()
        };
        assert_eq!((image.width, image.height(), image.white), (40, 24, 255), "{name}");
        let errors = found.iter().zip(ramps(channels)).map(|(a, b)| a.abs_diff(b));
        assert_eq!(found.len(), 960 * channels, "{name}");
        let (sum, worst) = errors.fold((0, 0), |(sum, worst), e| (sum + usize::from(e), worst.max(e)));
        assert!(worst <= tolerance && sum <= 2 * found.len(), "{name}: {worst}, {sum}");
        for length in 0..bytes.len() {
            let read = LevelImage::decode(&bytes[..length], &Limits::default());
            // Values of optional tags may be at the end of a TIFF.
            assert!(read.is_err() || name.ends_with("tif"), "{name}: {length} bytes");
        }
    }
    assert_eq!(Stack::decode(&corpus("jpeg-grey.tif"), &Limits::default()).unwrap().width, 40);
}

#[test]
fn jpeg_files_are_refused_where_they_are_unsuitable() {
    let says = |problem: InputError, what: &str| assert!(problem.to_string().contains(what), "{problem}");
    says(labels(&corpus("jpeg-grey.jpg")).unwrap_err(), "which changes labels");
    says(labels(&corpus("jpeg-grey.tif")).unwrap_err(), "which changes labels");
    says(grey(&corpus("jpeg-colour.jpg")).unwrap_err(), "is coloured");
    says(grey(&corpus("jpeg-cmyk.jpg")).unwrap_err(), "CMYK");
    says(grey(&corpus("jpeg-vast.jpg")).unwrap_err(), "the image is 32767 x 32767");
    // The size in the JPEG stream within a TIFF file is checked too.
    says(grey(&corpus("jpeg-vast.tif")).unwrap_err(), "the image is 16383 x 16383");
}

#[cfg(unix)]
#[test]
fn pipes_are_not_read() {
    let scratch = Scratch::new("pipe");
    let path = scratch.join("x.png");
    assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
    let error = GreyImage::read(&path, &Limits::default()).unwrap_err();
    assert!(error.to_string().ends_with("x.png: is a pipe, device or socket; expected a regular file"), "{error}");
    let fields = papsynth_dataset::field_files(scratch.path()).unwrap();
    assert!(fields[0].read(&Limits::default()).is_err());
    assert!(GreyImage::read(Path::new("/dev/zero"), &Limits::default()).is_err());
}

#[test]
fn errors_name_the_file_and_its_kind() {
    let scratch = Scratch::new("read-files");
    let path = scratch.join("small.png");
    fs::write(&path, grey_png(&[1, 2, 3, 4], 2)).unwrap();
    assert_eq!(read_label_map(&path, &Limits::default()).unwrap(), map(2, &[1, 2, 3, 4]));
    let small = Limits { max_file_bytes: 20, ..Limits::default() };
    let error = GreyImage::read(&path, &small).unwrap_err();
    assert!(error.to_string().contains("small.png: the file has") && !error.is_io(), "{error}");
    for (path, what) in [(scratch.join("none.png"), "no such file"), (scratch.path().to_owned(), "is a folder")] {
        let error = GreyImage::read(&path, &Limits::default()).unwrap_err();
        assert!(error.to_string().contains(what) && !error.is_io(), "{error}");
    }
}

#[test]
fn a_nucleus_is_one_component_of_several_pixels() {
    let image = || GreyImage { width: 4, grey: vec![100; 12], white: 255 };
    let sample = |ids: &[u32]| NucleusSample::new("n", image(), &map(4, ids));
    let good = sample(&[0, 255, 0, 0, 0, 0, 255, 0, 0, 3, 0, 0]).unwrap();
    assert_eq!(good.mask.iter().sum::<f32>(), 3.0);
    let wrong = |mask: &[u32]| sample(mask).unwrap_err().to_string();
    assert!(wrong(&[0; 12]).starts_with("the mask is empty"));
    assert!(wrong(&[0, 0, 0, 0, 0, 0, 9, 0, 0, 0, 0, 0]).starts_with("the mask has only one pixel, at (2, 1)"));
    assert!(wrong(&[1, 0, 1, 0, 0, 0, 0, 0, 1, 1, 1, 1]).starts_with("the mask has 3 connected components"));
    let wrong = NucleusSample::new("n", image(), &map(3, &[1; 12])).unwrap_err().to_string();
    assert!(wrong.starts_with("the mask is 3 x 4 pixels, the image 4 x 3"));
}

#[test]
fn folders_of_nuclei_are_paired_by_name() {
    let scratch = Scratch::new("nuclei");
    let put = |name: &str, bytes: &[u8]| {
        let path = scratch.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    };
    let read = || read_nuclei(scratch.path(), &Limits::default());
    let fails = |what: &str| {
        let error = read().unwrap_err();
        assert!(error.to_string().contains(what) && !error.is_io(), "{error}");
    };
    fails("no such folder");
    put("images/.DS_Store", b"");
    put("images/notes.txt", b"");
    put("masks/b.tif", &tiff::<colortype::Gray8>(&[0, 1, 1, 0], [2, 2], 1));
    fails("images: contains no PNG, JPEG or TIFF file");
    put("images/b.png", &grey_png(&[9, 8, 7, 6], 2));
    put("images/a.png", &grey_png(&[1, 2, 3, 4], 2));
    fails("a.png: there is no mask of the same name");
    put("masks/a.PNG", &grey_png(&[255, 255, 0, 0], 2));
    let names: Vec<String> = read().unwrap().into_iter().map(|n| n.name).collect();
    assert_eq!(names, ["a", "b"]);
    put("masks/c.png", &grey_png(&[0; 4], 2));
    fails("c.png: there is no image of the same name");
    put("images/c.png", &grey_png(&[0; 4], 2));
    fails("masks/c.png: the mask is empty");
    put("masks/c.png", &grey_png(&[255; 6], 2));
    fails("masks/c.png: the mask is 2 x 3 pixels, the image 2 x 2");
    put("images/c.tif", b"");
    fails("only in its extension");
    fs::remove_file(scratch.join("images/c.tif")).unwrap();
    for name in ["d.bmp", "e.CZI", "f.webp", "g.svs"] {
        put(&format!("images/{name}"), b"");
    }
    fails("images: 4 images are in other formats: d.bmp, e.CZI, f.webp and 1 more; expected PNG, JPEG or TIFF");
}

#[test]
fn outlines_are_read_by_their_columns() {
    let table = b"k,outline,x_px,y_px,extra\n0,a,1,2,\n1,a,3.5,2,\n2,a,1e1,-7,\n0,b,0,0,\n1,b,1,0,\n2,b,0,1,\n";
    let read = outlines(table).unwrap();
    assert_eq!((read.len(), read[0].name.as_str(), read[1].name.as_str()), (2, "a", "b"));
    assert_eq!(read[0].points, [[1.0, 2.0], [3.5, 2.0], [10.0, -7.0]]);
    let says = |text: &str, what: &str| {
        let problem = outlines(text.as_bytes()).unwrap_err().to_string();
        assert!(problem.contains(what), "{problem}");
    };
    says("outline,k,x_px\n", "line 1: the column `y_px` is missing");
    says("outline,k,x_px,y_px\n", "no outline");
    says("outline,k,x_px,y_px\na,0,1,nan\n", "line 2: y_px is `nan`");
    says("outline,k,x_px,y_px\na,0,1,2\na,2,1,2\n", "line 3: k is `2`; expected 1");
    says("outline,k,x_px,y_px\na,0,1,2\na,1,1,2\n", "outline `a` has 2 points");
    says("outline,k,x_px,y_px\na,0,1,2\na,1,1\n", "line 3");
    says("outline,k,x_px,y_px\na,0,1,\u{fffd}\n", "line 2");
}

#[test]
fn weight_maps_need_a_pixel_above_0() {
    let scratch = Scratch::new("weights");
    let mut recipe = support::recipe();
    let read = |recipe: &Recipe| {
        let mut named = recipe.clone();
        let (inputs, file) = read_inputs(&mut named, scratch.path(), &Limits::default())?;
        Ok::<_, Error>((inputs.weight_map, file, named.layout))
    };
    assert_eq!(read(&recipe).unwrap(), (None, None, recipe.layout.clone()));
    recipe.layout = Layout::DensityMap { path: "map.png".to_owned() };
    assert!(read(&recipe).unwrap_err().to_string().contains("map.png: there is no such file"));
    fs::write(scratch.join("map.png"), grey_png(&[0, 51, 255, 0], 2)).unwrap();
    let (found, file, layout) = read(&recipe).unwrap();
    let found = found.unwrap();
    assert_eq!((found.width, found.weights), (2, vec![0.0, 0.2, 1.0, 0.0]));
    let file = file.unwrap();
    assert_eq!(file.bytes, grey_png(&[0, 51, 255, 0], 2));
    assert_eq!(layout, Layout::DensityMap { path: file.name.clone() });
    fs::write(scratch.join("map.png"), grey_png(&[0, 52, 255, 0], 2)).unwrap();
    assert_ne!(read(&recipe).unwrap().1.unwrap().name, file.name, "the name depends on the content");
    recipe.layout = Layout::Labels(Labels { path: "map.png".to_owned(), smooth_um: 1.0.into() });
    assert_eq!(read(&recipe).unwrap().0.unwrap().weights, [0.0, 1.0, 1.0, 0.0]);
    fs::write(scratch.join("map.png"), grey_png(&[0; 4], 2)).unwrap();
    let refused = |recipe: &Recipe| read(recipe).unwrap_err().to_string().contains("map.png: all pixels are 0");
    assert!(refused(&recipe));
    recipe.layout = Layout::DensityMap { path: "map.png".to_owned() };
    assert!(refused(&recipe));
}

#[test]
fn too_many_regions_are_refused_before_they_are_collected() {
    let checkers = LabelMap {
        width: 100,
        ids: (0..10_000).map(|i| if (i / 100) % 2 == 0 && i % 2 == 0 { 1 } else { 0 }).collect(),
    };
    let limited = |max_regions| components(&checkers, &Limits { max_regions, ..Limits::default() });
    assert_eq!(limited(2500).unwrap().len(), 2500);
    assert!(limited(2499).unwrap_err().to_string().starts_with("the image has more than 2499 separate regions"));
    // The teeth of a comb are separate regions until the last row joins them.
    let comb = LabelMap { width: 100, ids: (0..10_000).map(|i| u32::from(i >= 9_900 || i % 2 == 0)).collect() };
    assert_eq!(components(&comb, &Limits { max_regions: 1, ..Limits::default() }).unwrap().len(), 1);
}

/// Regions by flood fill.
fn flooded(labels: &LabelMap) -> Vec<(u32, Vec<usize>)> {
    let (width, height) = (labels.width, labels.ids.len() / labels.width);
    let mut seen = vec![false; labels.ids.len()];
    let mut regions = Vec::new();
    for start in 0..labels.ids.len() {
        if seen[start] || labels.ids[start] == 0 {
            continue;
        }
        let (mut region, mut todo) = (Vec::new(), vec![start]);
        seen[start] = true;
        while let Some(i) = todo.pop() {
            region.push(i);
            for (y, x) in (0..9).map(|k| (i / width + k / 3, i % width + k % 3)) {
                let inside = (1..=height).contains(&y) && (1..=width).contains(&x);
                let next = (y.max(1) - 1) * width + x.max(1) - 1;
                if inside && !seen[next] && labels.ids[next] == labels.ids[start] {
                    seen[next] = true;
                    todo.push(next);
                }
            }
        }
        region.sort_unstable();
        regions.push((labels.ids[start], region));
    }
    regions
}

proptest! {
    #[test]
    fn components_equal_those_of_flood_fill(width in 1_usize..20, height in 1_usize..20, ids in proptest::collection::vec(0_u32..3, 400)) {
        let labels = map(width, &ids[..width * height]);
        let found = components(&labels, &Limits::default()).unwrap();
        let expected = flooded(&labels);
        prop_assert_eq!(found.len(), expected.len());
        for (component, (label, pixels)) in found.iter().zip(&expected) {
            prop_assert_eq!(component.label, *label);
            prop_assert_eq!(&component.mask.pixels(width).collect::<Vec<_>>(), pixels);
            let border = |&i: &usize| [0, width - 1].contains(&(i % width)) || [0, height - 1].contains(&(i / width));
            prop_assert_eq!(component.at_border, pixels.iter().any(border));
            let (tile, tile_width, [x, y]) = component.tile();
            let drawn = (0..tile.len()).filter(|&i| tile[i] > 0.0);
            let drawn: Vec<usize> = drawn.map(|i| (i / tile_width + y as usize) * width + i % tile_width + x as usize).collect();
            prop_assert_eq!(&drawn, pixels);
        }
    }
}

/// The folder of real images, if there is one.
fn reference() -> Option<PathBuf> {
    let found = std::env::var_os("PAPSYNTH_REFERENCE").map(PathBuf::from).filter(|p| p.is_dir());
    if found.is_none() {
        eprintln!("skipped: PAPSYNTH_REFERENCE is not a folder");
    }
    found
}

#[test]
fn real_images_are_read() {
    let Some(folder) = reference() else { return };
    let limits = Limits::default();
    for (class, count) in [("normal", 60), ("high_grade", 5)] {
        assert_eq!(read_nuclei(&folder.join("nuclei").join(class), &limits).unwrap().len(), count);
    }
    for (file, count, points) in
        [("cytoplasm.csv", 70, 420), ("nucleus.csv", 60, 64), ("nucleus_high_grade.csv", 5, 64)]
    {
        let read = read_outlines(&folder.join("outlines").join(file), &limits).unwrap();
        assert_eq!(read.len(), count);
        assert!(read.iter().all(|o| o.points.len() == points));
    }
    let fields = image_files(Path::new(&folder.join("cytoplasm/labels"))).unwrap();
    assert_eq!(fields.len(), 13);
    for path in fields.values() {
        let regions = components(&read_label_map(path, &limits).unwrap(), &limits).unwrap();
        assert!(!regions.is_empty() && regions.len() < 100, "{}: {}", path.display(), regions.len());
    }
}
