//! Measured sections of recipes in TOML.

use std::fmt::Write;

use optics_psf::MicroscopeParams;
use papsynth::recipe::{Gaussians, Optics, Preset};
use toml::Value;

use crate::calibration::Calibration;
use crate::camera::Camera;
use crate::condenser::Bound;
use crate::edge::extra_blur;
use crate::error::Error;

/// The first bytes of every section that [`Calibration`] writes.
pub const PREFIX: &[u8] = b"# Measured by papsynth calibrate";

/// A section of a recipe, with a note on the origin of each field.
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
        format!("{}: {}\n\n{}", String::from_utf8_lossy(PREFIX), self.about, self.table())
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
    /// Returns the sections `[optics]` and `[light]` of a bright-field microscope in TOML; `None` if lengths in
    /// micrometres are unknown, or neither condenser nor edge were measured.
    ///
    /// # Errors
    /// If a parameter of the microscope is out of range.
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
        let note = condenser.map_or("not measured: default; --stack with --step-um measures it".to_owned(), |c| {
            let limit = if c.bound == Bound::Inside { String::new() } else { format!("{}; ", c.bound.words()) };
            format!("measured: {limit}{:.3} +- {:.3}", c.na, c.error)
        });
        section.set("condenser_na", condenser_na, note);
        section.set("mount_index", instrument.mount_index, "as given");
        section.set("immersion_index", instrument.immersion_index, "as given");
        section.set("cover_error_um", default.cover_error_um, "default");
        let (extra, note) = match &self.edge {
            None => (0.0, "not measured; --edge measures it".to_owned()),
            Some(found) => {
                let [expected_px, extra_px] = extra_blur(found, &params).map_err(Error::Microscope)?;
                let sigma_px = found.sigma_px;
                let note = format!("measured: edge blur {sigma_px:.3} px, of the objective alone {expected_px:.3} px");
                (extra_px * instrument.pixel_um, note)
            }
        };
        section.set("extra_blur_um", round(extra, 4), note);
        section.set("stray_light", default.stray_light, "default");
        let mut light = Section { name: "light", about: String::new(), fields: Vec::new() };
        light.set("kind", "monochrome", "");
        light.set("wavelength_um", instrument.wavelength_um, "as given");
        light.set("bandwidth_um", default.bandwidth_um, "default");
        Ok(Some(format!("{}\n{}", section.to_toml(), light.table())))
    }

    /// Returns the section `[optics]` with the Gaussians of the paper in TOML; `None` if lengths in micrometres are
    /// unknown, or neither focus nor edge were measured.
    #[must_use]
    pub fn gaussian_toml(&self) -> Option<String> {
        let instrument = self.microscope.as_ref()?;
        let z = self.focus.as_ref().and_then(|focus| Some((focus, instrument.pixel_um / focus.step_um?)));
        if z.is_none() && self.edge.is_none() {
            return None;
        }
        let mut section = Section {
            name: "optics",
            about: format!("Gaussians of the paper, with pixels of {} um", instrument.pixel_um),
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
            ("sigma_xy_um", xy, paper.sigma_xy_um, "--edge measures it"),
            ("sigma_z_um_per_um", z, paper.sigma_z_um_per_um, "--stack with --step-um measures it"),
        ] {
            match found {
                Some([value, error]) => {
                    section.set(key, round(value, 4), format!("measured: {value:.4} +- {error:.4}"))
                }
                None => {
                    let paper = Value::try_from(paper).unwrap_or(Value::Float(0.0));
                    section.set(key, paper, format!("not measured: value of the paper; {option}"));
                }
            }
        }
        Some(section.to_toml())
    }

    /// Returns the section `[camera]` in TOML, or `None` if no camera was measured.
    #[must_use]
    pub fn camera_toml(&self) -> Option<String> {
        let Camera { bits, gain_dn_per_e, full_scale_e, offset_dn, dark_noise_e, dsnu_e, prnu, .. } =
            self.camera.as_ref()?;
        let about = format!("a camera with {gain_dn_per_e:.5} grey levels per electron");
        let mut section = Section { name: "camera", about, fields: Vec::new() };
        section.set("bits", i64::from(*bits), "bits of a grey level");
        section.set("full_well_e", round(*full_scale_e, 0), "measured: electrons of the largest grey level");
        section.set("read_noise_e", round(*dark_noise_e, 3), "measured: dark noise, without quantization noise");
        section.set("offset_dn", round(*offset_dn, 3), "measured: mean dark level");
        section.set("prnu", round(*prnu, 5), "measured: relative standard deviation of the response");
        section.set("dsnu_e", round(*dsnu_e, 3), "measured: standard deviation of the dark signal, electrons");
        section.set("photon_noise", "exact", "");
        section.set("dark_current_e_per_s", 0.0, "not measured: included in the offset");
        Some(section.to_toml())
    }
}

/// Rounds to a number of decimals.
fn round(value: f64, digits: usize) -> f64 {
    format!("{value:.digits$}").parse().unwrap_or(value)
}
