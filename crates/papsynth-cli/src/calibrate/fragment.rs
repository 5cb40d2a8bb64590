//! Parts of recipes that were measured, as `papsynth generate` reads them.

use std::fmt::Write;

use optics_psf::MicroscopeParams;
use papsynth::recipe::Preset;
use toml::{Table, Value};

use super::edge;
use super::record::{Bound, CameraRecord, Record};
use crate::exit::{Complaint, Failure};

/// How every fragment begins.
pub(super) const BEGINS: &[u8] = b"# Measured by papsynth calibrate";

/// One section of a recipe, each field with where it is from.
struct Section {
    name: &'static str,
    about: String,
    fields: Vec<(String, Value, String)>,
}

impl Section {
    fn set(&mut self, key: &str, value: impl Into<Value>, note: impl Into<String>) {
        self.fields.push((key.to_owned(), value.into(), note.into()));
    }

    fn to_toml(&self) -> String {
        format!("{}: {}\n\n{}", String::from_utf8_lossy(BEGINS), self.about, self.table())
    }

    fn table(&self) -> String {
        let mut out = format!("[{}]\n", self.name);
        for (key, value, note) in &self.fields {
            let field = format!("{key} = {value}");
            // Writing to a string cannot fail.
            let _ = if note.is_empty() { writeln!(out, "{field}") } else { writeln!(out, "{field:<36}# {note}") };
        }
        out
    }
}

/// The optics as a bright-field microscope; nothing if no length in micrometres is known, or nothing was measured.
pub(super) fn bright_field(record: &Record) -> Result<Option<String>, Failure> {
    let Some(instrument) = &record.microscope else { return Ok(None) };
    let condenser = record.focus.as_ref().and_then(|focus| focus.condenser.as_ref());
    if condenser.is_none() && record.edge.is_none() {
        return Ok(None);
    }
    let default = MicroscopeParams::default();
    let condenser_na = condenser.map_or(default.condenser_na, |c| round(c.na, 3));
    let params = instrument.params(condenser_na);
    let mut section = Section {
        name: "optics",
        about: format!("a bright-field microscope, with pixels of {} um", instrument.pixel_um),
        fields: Vec::new(),
    };
    section.set("kind", "bright-field", "");
    section.set("na", instrument.na, "as given");
    let note = condenser.map_or("not measured: the default; --stack with --step-um finds it".to_owned(), |c| {
        let limit = match c.bound {
            Bound::Inside => "",
            Bound::AtMost => "at most; ",
            Bound::AtLeast => "at least; ",
        };
        format!("measured: {limit}{:.3} +- {:.3}", c.na, c.error)
    });
    section.set("condenser_na", condenser_na, note);
    section.set("mount_index", instrument.mount_index, "as given");
    section.set("immersion_index", instrument.immersion_index, "as given");
    section.set("cover_error_um", default.cover_error_um, "the default");
    let (extra, note) = match &record.edge {
        None => (0.0, "not measured: --edge finds it".to_owned()),
        Some(found) => {
            let edge::Beyond { expected_px, extra_px } = edge::beyond(found, &params)
                .map_err(|error| Failure::input(Complaint::new(format!("--edge: the microscope: {error}"))))?;
            let sigma_px = found.sigma_px;
            let note = format!("measured: an edge of {sigma_px:.3} px, where the lens alone makes {expected_px:.3} px");
            (extra_px * instrument.pixel_um, note)
        }
    };
    section.set("extra_blur_um", round(extra, 4), note);
    section.set("stray_light", default.stray_light, "the default");
    let mut light = Section { name: "light", about: String::new(), fields: Vec::new() };
    light.set("kind", "monochrome", "");
    light.set("wavelength_um", instrument.wavelength_um, "as given");
    light.set("bandwidth_um", default.bandwidth_um, "the default");
    Ok(Some(format!("{}\n{}", section.to_toml(), light.table())))
}

/// The optics as the paper has them; nothing if no length in micrometres is known, or nothing was measured.
pub(super) fn gaussian(record: &Record) -> Option<String> {
    let instrument = record.microscope.as_ref()?;
    let z = record.focus.as_ref().and_then(|focus| Some((focus, instrument.pixel_um / focus.step_um?)));
    if z.is_none() && record.edge.is_none() {
        return None;
    }
    let mut section = Section {
        name: "optics",
        about: format!("the paper's Gaussians, with pixels of {} um", instrument.pixel_um),
        fields: Vec::new(),
    };
    section.set("kind", "gaussian", "");
    let xy = record.edge.as_ref().map(|edge| [edge.sigma_px, edge.error_px].map(|px| px * instrument.pixel_um));
    let z = z.map(|(focus, scale)| [focus.proportional_px, focus.proportional_error_px].map(|px| px * scale));
    for (key, found, option) in
        [("sigma_xy_um", xy, "--edge finds it"), ("sigma_z_um_per_um", z, "--stack with --step-um finds it")]
    {
        match found {
            Some([value, error]) => section.set(key, round(value, 4), format!("measured: {value:.4} +- {error:.4}")),
            None => {
                let paper = papers_optics().remove(key).unwrap_or(Value::Float(0.0));
                section.set(key, paper, format!("not measured: the paper's; {option}"));
            }
        }
    }
    Some(section.to_toml())
}

/// The camera, in the words of a recipe: here is what the engine's fields are called.
pub(super) fn camera(record: &Record) -> Option<String> {
    let CameraRecord { bits, gain_dn_per_e, full_scale_e, offset_dn, dark_noise_e, dsnu_e, prnu, .. } =
        record.camera.as_ref()?;
    let about = format!("a camera of {gain_dn_per_e:.5} grey levels per electron");
    let mut section = Section { name: "camera", about, fields: Vec::new() };
    section.set("bits", i64::from(*bits), "of the converter");
    section.set("full_well_e", round(*full_scale_e, 0), "measured: electrons that the largest grey level stands for");
    section.set("read_noise_e", round(*dark_noise_e, 3), "measured: noise in the dark, without that of rounding");
    section.set("offset_dn", round(*offset_dn, 3), "measured: mean in the dark");
    section.set("prnu", round(*prnu, 5), "measured: spread of the pixels' responses");
    section.set("dsnu_e", round(*dsnu_e, 3), "measured: spread of the pixels' offsets, electrons");
    section.set("photon_noise", "exact", "");
    section.set("dark_current_e_per_s", 0.0, "not measured: a part of the offset");
    Some(section.to_toml())
}

/// The optics of the paper's preset.
fn papers_optics() -> Table {
    let recipe: Table = toml::from_str(&Preset::Paper2015.recipe().to_toml()).unwrap_or_default();
    recipe.get("optics").and_then(Value::as_table).cloned().unwrap_or_default()
}

/// A number of no more digits than were measured.
fn round(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$}").parse().unwrap_or(value)
}
