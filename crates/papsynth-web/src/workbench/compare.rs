//! The comparison of an image with that of the user, as the judge measures them.

use papsynth::white_level;
use papsynth_judge::{Detail, FieldImage, Measurer, MeasurerParams, Statistics, describe, frequencies};
use serde::Deserialize;
use serde_json::{Value, json};

use super::real::RealImage;
use super::rendering::Renderer;
use crate::server::Reply;

/// A request for a comparison.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CompareRequest {
    /// Number of the image.
    id: usize,
    /// Number of the image of the user.
    pub(super) real: usize,
    /// Pixel size of the image of the user, µm.
    pixel_um: f64,
}

/// Grey levels of an image, channels interleaved.
pub(super) struct Grey<'a> {
    pub(super) levels: &'a [u16],
    pub(super) channels: usize,
    pub(super) width: usize,
    pub(super) bits: u32,
}

impl<'a> Grey<'a> {
    pub(super) fn of(RealImage { image, bits }: &'a RealImage) -> Self {
        Self { levels: &image.levels, channels: image.channels, width: image.width, bits: *bits }
    }
}

/// Returns the statistics of both images. The image with smaller pixels is resampled, so that both have the same.
pub(super) fn compared(asked: &CompareRequest, renderer: &Renderer, real: &RealImage) -> Result<Reply, Reply> {
    let (ours, own_um) = renderer.with_grey(asked.id, |grey, pixel_um| (field_image(grey), pixel_um))?;
    let theirs = field_image(&Grey::of(real));
    let invalid = |error: papsynth_judge::Error| Reply::error(422, &error.to_string());
    let pixel_um = asked.pixel_um.max(own_um);
    let params = MeasurerParams { pixel_um, detail: Detail::Statistics, ..MeasurerParams::default() };
    let measurer = Measurer::new(&params).map_err(invalid)?;
    let measured = |image: &FieldImage, um: f64| {
        let factor = pixel_um / um;
        let measure = |image: &FieldImage| measurer.measure(image).map(|field| field.statistics).map_err(invalid);
        if factor > 1.0 { measure(&image.coarsened(factor)) } else { measure(image) }
    };
    let [ours, theirs] = [measured(&ours, own_um)?, measured(&theirs, asked.pixel_um)?];
    Ok(Reply::json(&report(&ours, &theirs, pixel_um)))
}

/// Returns the grey levels, of three channels the green ones.
pub(super) fn field_image(grey: &Grey<'_>) -> FieldImage {
    let green = usize::from(grey.channels == 3);
    let full_scale = white_level(grey.bits).into();
    FieldImage { grey: channel(grey, green), width: grey.width, full_scale, ..FieldImage::default() }
}

/// Returns the grey levels of a channel.
pub(super) fn channel(grey: &Grey<'_>, number: usize) -> Vec<f32> {
    grey.levels.iter().skip(number).step_by(grey.channels.max(1)).map(|&level| f32::from(level)).collect()
}

fn report(ours: &Statistics, theirs: &Statistics, pixel_um: f64) -> Value {
    let scalar = |((name, ours), (_, theirs)): ((&str, f64), (&str, f64))| {
        let scale = ours.abs().max(theirs.abs()).max(f64::MIN_POSITIVE);
        let difference = ((ours - theirs) / scale).abs().min(1.0);
        let is_known = ours.is_finite() && theirs.is_finite();
        is_known
            .then(|| json!({ "description": describe(name), "ours": ours, "theirs": theirs, "difference": difference }))
    };
    let scalars: Vec<Value> = ours.scalars().into_iter().zip(theirs.scalars()).filter_map(scalar).collect();
    json!({
        "scalars": scalars,
        "spectrum": {
            "at": frequencies().map(|frequency| pixel_um / frequency),
            "ours": ours.spectrum,
            "theirs": theirs.spectrum,
        },
        "profile": { "ours": ours.profile, "theirs": theirs.profile },
    })
}
