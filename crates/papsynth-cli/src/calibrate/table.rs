//! Tables of measurements.

use papsynth_calibrate::{Bound, Camera, Condenser, Edge, Focus, Level, Saturation};

pub(super) fn focus(record: &Focus, pixel_um: Option<f64>) -> String {
    let mut out = String::new();
    let mut line = |text: String| out.push_str(&format!("{}\n", text.trim_end()));
    line("blur against focus offset (Fig. 10)".to_owned());
    for nucleus in &record.nuclei {
        let [x, y, w, h] = nucleus.window;
        line(format!("  window {x},{y},{w},{h}: in focus in plane {}", nucleus.focused));
    }
    let um = |known: bool, name: &str| if known { format!("{name:>10}") } else { String::new() };
    let (step, sigma) = (um(record.step_um.is_some(), "um"), um(pixel_um.is_some(), "sigma um"));
    line(format!(
        "{:>8}{step}{:>8}{:>10}{sigma}{:>16}{:>10}",
        "planes", "nuclei", "sigma px", "quartiles px", "line px"
    ));
    for o in &record.offsets {
        let n = o.planes.abs() as f64;
        let side = if o.planes < 0 { &record.before } else { &record.after };
        let fit = if o.fitted { format!("{:.2}", side.at(n)) } else { "-".to_owned() };
        let step = record.step_um.map_or_else(String::new, |step| format!("{:>+10.2}", o.planes as f64 * step));
        let sigma = pixel_um.map_or_else(String::new, |pixel| format!("{:>10.3}", o.sigma_px * pixel));
        let quartiles = format!("{:.2} to {:.2}", o.quartiles_px[0], o.quartiles_px[1]);
        line(format!("{:>+8}{step}{:>8}{:>10.2}{sigma}{quartiles:>16}{fit:>10}", o.planes, o.nuclei, o.sigma_px));
    }
    for (name, side) in [("before focus", &record.before), ("after focus", &record.after)] {
        line(format!(
            "{name:<14}{:.3} px per plane, {:+.2} px in focus, R2 {:.4}; through 0: {:.3} px per plane",
            side.slope_px, side.intercept_px, side.r_squared, side.proportional_px
        ));
    }
    line(format!("symmetry      the slopes differ by {:.1} %", 100.0 * record.asymmetry));
    let (k, error) = (record.proportional_px, record.proportional_error_px);
    line(format!("blur          {k:.3} +- {error:.3} px per plane"));
    if let Some(step) = record.step_um {
        line(format!("              {:.3} +- {:.3} px per um of travel", k / step, error / step));
    }
    if let (Some(step), Some(pixel)) = (record.step_um, pixel_um) {
        let scale = pixel / step;
        line(format!("              {:.3} +- {:.3} um per um of travel", k * scale, error * scale));
    }
    if let Some(Condenser { na, error, bound }) = &record.condenser {
        let space = if *bound == Bound::Inside { "" } else { " " };
        line(format!("condenser NA  {}{space}{na:.3} +- {error:.3}", bound.words()));
    }
    out
}

pub(super) fn edge(record: &Edge, pixel_um: Option<f64>) -> String {
    let mut out = String::new();
    let [x, y, w, h] = record.window;
    let (sigma, error) = (record.sigma_px, record.error_px);
    let turn = libm::atan2(record.normal[1], record.normal[0]).to_degrees();
    let mut line = |text: String| out.push_str(&format!("{text}\n"));
    line("edge".to_owned());
    line(format!("  window {x},{y},{w},{h}: lighter towards {turn:.0} degrees (0 right, 90 down)"));
    let Edge { dark, light, difference, .. } = record;
    line(format!("levels        {dark:.4} dark, {light:.4} light, {difference:.4} residual of the fit"));
    line(format!("sigma_xy      {sigma:.3} +- {error:.3} px, including the width of the pixel"));
    if let Some(pixel) = pixel_um {
        line(format!("              {:.4} +- {:.4} um", sigma * pixel, error * pixel));
    }
    out
}

pub(super) fn camera(record: &Camera) -> String {
    let mut out = String::from("photon transfer (EMVA 1288)\n");
    let mut line = |text: String| out.push_str(&format!("{}\n", text.trim_end()));
    line(format!("{:>8}{:>12}{:>14}{:>12}  level", "frames", "mean DN", "variance DN2", "saturated"));
    for level in &record.levels {
        let Level { frames, mean_dn, variance_dn2, name, .. } = level;
        let highest = 100.0 * level.at_highest;
        line(format!("{frames:>8}{mean_dn:>12.2}{variance_dn2:>14.3}{highest:>10.2} %  {name}"));
    }
    let gain = record.gain_dn_per_e;
    line(format!("gain          {gain:.5} DN per electron, {:.2} electrons per DN", 1.0 / gain));
    line(format!("full scale    {:.0} electrons at {} bits", record.full_scale_e, record.bits));
    let Saturation { reached, dn, e } = &record.saturation;
    let from = if *reached { "" } else { "not reached, above " };
    line(format!("saturation    {from}{e:.0} electrons, {dn:.1} DN above dark"));
    line(format!("offset        {:.2} DN", record.offset_dn));
    line(format!("dark noise    {:.2} electrons", record.dark_noise_e));
    line(format!("DSNU          {:.2} electrons", record.dsnu_e));
    line(format!("PRNU          {:.2} %", 100.0 * record.prnu));
    out
}
