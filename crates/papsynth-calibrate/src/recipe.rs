//! Sections of recipes that were measured, as `papsynth generate` reads them.

use std::fmt::Write;

use optics_psf::MicroscopeParams;
use papsynth::recipe::{Gaussians, Optics, Preset};
use toml::Value;

use crate::calibration::Calibration;
use crate::camera::Camera;
use crate::condenser::Bound;
use crate::edge::beyond;
use crate::error::Error;

/// The first bytes of every text that [`Calibration`] writes for a recipe.
pub const BEGINS: &[u8] = b"# Measured by papsynth calibrate";

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

impl Calibration {
    /// The sections `[optics]` and `[light]` of a bright-field microscope, in TOML; nothing if no length in micrometres is
    /// known, or nothing was measured.
    ///
    /// # Errors
    /// If the optics cannot compute the microscope.
    pub fn bright_field_toml(&self) -> Result<Option<String>, Error> {
        let Some(instrument) = &self.microscope else { return Ok(None) };
        let condenser = self.focus.as_ref().and_then(|focus| focus.condenser.as_ref());
        if condenser.is_none() && self.edge.is_none() {
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
            let limit = if c.bound == Bound::Inside { String::new() } else { format!("{}; ", c.bound.words()) };
            format!("measured: {limit}{:.3} +- {:.3}", c.na, c.error)
        });
        section.set("condenser_na", condenser_na, note);
        section.set("mount_index", instrument.mount_index, "as given");
        section.set("immersion_index", instrument.immersion_index, "as given");
        section.set("cover_error_um", default.cover_error_um, "the default");
        let (extra, note) = match &self.edge {
            None => (0.0, "not measured: --edge finds it".to_owned()),
            Some(found) => {
                let [expected_px, extra_px] = beyond(found, &params).map_err(Error::Microscope)?;
                let sigma_px = found.sigma_px;
                let note =
                    format!("measured: an edge of {sigma_px:.3} px, where the lens alone makes {expected_px:.3} px");
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

    /// The section `[optics]` of the paper's Gaussians, in TOML; nothing if no length in micrometres is known, or nothing
    /// was measured.
    #[must_use]
    pub fn gaussian_toml(&self) -> Option<String> {
        let instrument = self.microscope.as_ref()?;
        let z = self.focus.as_ref().and_then(|focus| Some((focus, instrument.pixel_um / focus.step_um?)));
        if z.is_none() && self.edge.is_none() {
            return None;
        }
        let mut section = Section {
            name: "optics",
            about: format!("the paper's Gaussians, with pixels of {} um", instrument.pixel_um),
            fields: Vec::new(),
        };
        section.set("kind", "gaussian", "");
        let xy = self.edge.as_ref().map(|edge| [edge.sigma_px, edge.error_px].map(|px| px * instrument.pixel_um));
        let z = z.map(|(focus, scale)| [focus.proportional_px, focus.proportional_error_px].map(|px| px * scale));
        let paper = match Preset::Paper2015.recipe().optics {
            Optics::Gaussian(paper) => paper,
            _ => Gaussians::default(),
        };
        for (key, found, paper, option) in [
            ("sigma_xy_um", xy, paper.sigma_xy_um, "--edge finds it"),
            ("sigma_z_um_per_um", z, paper.sigma_z_um_per_um, "--stack with --step-um finds it"),
        ] {
            match found {
                Some([value, error]) => {
                    section.set(key, round(value, 4), format!("measured: {value:.4} +- {error:.4}"))
                }
                None => {
                    let paper = Value::try_from(paper).unwrap_or(Value::Float(0.0));
                    section.set(key, paper, format!("not measured: the paper's; {option}"));
                }
            }
        }
        Some(section.to_toml())
    }

    /// The section `[camera]`, in TOML; nothing if no camera was measured.
    #[must_use]
    pub fn camera_toml(&self) -> Option<String> {
        let Camera { bits, gain_dn_per_e, full_scale_e, offset_dn, dark_noise_e, dsnu_e, prnu, .. } =
            self.camera.as_ref()?;
        let about = format!("a camera of {gain_dn_per_e:.5} grey levels per electron");
        let mut section = Section { name: "camera", about, fields: Vec::new() };
        section.set("bits", i64::from(*bits), "of the converter");
        section.set(
            "full_well_e",
            round(*full_scale_e, 0),
            "measured: electrons that the largest grey level stands for",
        );
        section.set("read_noise_e", round(*dark_noise_e, 3), "measured: noise in the dark, without that of rounding");
        section.set("offset_dn", round(*offset_dn, 3), "measured: mean in the dark");
        section.set("prnu", round(*prnu, 5), "measured: spread of the pixels' responses");
        section.set("dsnu_e", round(*dsnu_e, 3), "measured: spread of the pixels' offsets, electrons");
        section.set("photon_noise", "exact", "");
        section.set("dark_current_e_per_s", 0.0, "not measured: a part of the offset");
        Some(section.to_toml())
    }
}

/// A number of no more digits than were measured.
fn round(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$}").parse().unwrap_or(value)
}
