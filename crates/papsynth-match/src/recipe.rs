//! Conversion between parameter values and recipes.

use papsynth::recipe::{
    Abundance, CellMix, Clusters, Condition, Distribution, FocusOutput, Gaussians, Illumination, Layout, Microscope,
    Number, Optics, Preset, Quadratic, Recipe,
};

use crate::parameter::{Level, PARAMETERS, Parameter as P, Source, Values};

/// Fixed properties of a matched recipe.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// Initial recipe.
    pub base: Recipe,
    /// Width and height of a field.
    pub size_px: [usize; 2],
    /// Pixel size, µm. [`P::Pixel`] replaces it if it is sought.
    pub pixel_um: f64,
    /// Bits per pixel.
    pub bits: u32,
    /// Whether noise is correlated between pixels, as in EDF images.
    pub extended: bool,
    /// Whether the pixel size is sought.
    pub seek_pixel: bool,
}

/// Maximum grey level of 8 bits.
pub(crate) const LEVELS: f64 = 255.0;

/// Mean loss of light by the background texture, relative to its strength.
const TEXTURE_LOSS: f64 = 0.5;

/// Half the range of the softness of edges of nuclei within a field, relative to its mean: with 0.1 µm, the blur of
/// borders differed between nuclei of a field 0.55 times as much as in fields of Cervix93.
const EDGES: f64 = 0.9;

/// Variance of rounding to grey levels of 8 bits.
const ROUNDING: f64 = 1.0 / 12.0;

impl Setting {
    /// Returns whether a parameter can be sought: not the radius of clusters without clusters, for example.
    #[must_use]
    pub fn seeks(&self, parameter: P) -> bool {
        match parameter {
            P::NoiseCorrelationX | P::NoiseCorrelationY => self.extended,
            P::Pixel => self.seek_pixel,
            P::Size => !self.seek_pixel,
            P::StrayLight => matches!(self.base.optics, Optics::BrightField(_)),
            P::Degeneration => centre(&self.base.cytoplasm.degeneration) > 0.0,
            P::Outside | P::ClusterRadius => matches!(self.base.layout, Layout::Clusters(_)),
            P::Superficial => PAIR.iter().all(|class| self.base.cells.contains_key(*class)),
            P::Lesion => {
                let lesions = self.base.cells.keys().filter(|class| LESIONS.contains(&class.as_str())).count();
                lesions > 0 && lesions < self.base.cells.len()
            }
            _ => true,
        }
    }

    /// Returns whether a parameter differs between fields. The blur of EDF images does not: each part comes from the
    /// plane in which it is sharpest. Evenly distributed stray light does not either.
    #[must_use]
    pub fn varies(&self, parameter: P) -> bool {
        let is_shared = match parameter {
            P::Blur => self.extended,
            P::StrayLight => match &self.base.optics {
                Optics::BrightField(Microscope { stray_light_um, .. }) => centre(stray_light_um) <= 0.0,
                Optics::Gaussian(_) => true,
            },
            _ => false,
        };
        parameter.prior().level == Level::Field && !is_shared
    }

    /// Returns the values of the initial recipe.
    #[must_use]
    pub fn base_values(&self) -> Values {
        let base = &self.base;
        let area = base_area(base);
        let level = centre(&base.background.level) - TEXTURE_LOSS * centre(&base.background.texture);
        let (x2, y2) = match &base.background.illumination {
            Illumination::Quadratic(Quadratic { falloff_x, falloff_y, .. }) => (centre(falloff_x), centre(falloff_y)),
            Illumination::Border(_) => (0.0, 0.0),
        };
        let camera = &base.camera;
        let glare = centre(&camera.glare_subtracted);
        let signal = signal(level, glare);
        let per_dn = centre(&camera.full_well_e) * (1.0 - glare) / LEVELS;
        let (photons, read) = (signal / per_dn, centre(&camera.read_noise_e) / per_dn);
        let pattern = libm::hypot(centre(&camera.prnu) * signal, centre(&camera.dsnu_e) / per_dn);
        let noise = photons + read * read + pattern * pattern + ROUNDING;
        let counts: f64 = base.cells.values().map(|mix| density(&mix.count, area)).sum();
        let [superficial, intermediate] = of_pair(base);
        let lesions: f64 = lesions(base).map(|mix| density(&mix.count, area)).sum();
        let (radius, outside) = match &base.layout {
            Layout::Clusters(Clusters { radius_um, outside, .. }) => (centre(radius_um), centre(outside)),
            _ => (30.0, 1.0),
        };
        let mut optics = base.optics.clone();
        let stray_light = stray_light(&mut optics).map_or(0.0, |number| centre(number));
        let blur = blur(&mut optics);
        let debris = &base.debris;
        let mut values = Values::zero();
        for (parameter, value) in [
            (P::Level, level),
            (P::FalloffX, x2),
            (P::FalloffY, y2),
            (P::Noise, noise.sqrt()),
            (P::Pattern, pattern * pattern / noise),
            (P::NoiseCorrelationX, centre(&base.focus.noise_correlation_x)),
            (P::NoiseCorrelationY, centre(&base.focus.noise_correlation_y)),
            (P::Pixel, centre(&base.field.pixel_um)),
            (P::Photons, photons / (photons + read * read).max(1e-9)),
            (P::Blur, centre(blur)),
            (P::StrayLight, stray_light),
            (P::Depth, centre(&base.slide.depth_um)),
            (P::FieldCytoplasm, centre(&base.stain.field_cytoplasm) * centre(&base.stain.slide_cytoplasm)),
            (P::FieldNucleus, centre(&base.stain.field_nucleus) * centre(&base.stain.slide_nucleus)),
            (P::Texture, centre(&base.stain.field_texture)),
            (P::CytoplasmVariation, centre(&base.stain.cytoplasm_variation)),
            (P::NucleusVariation, centre(&base.stain.nucleus_variation)),
            (P::Dome, centre(&base.nucleus.dome)),
            (P::Rim, centre(&base.nucleus.rim)),
            (P::Edge, centre(&base.nucleus.edge_um)),
            (P::Clumping, centre(&base.nucleus.clumping)),
            (P::Pyknotic, centre(&base.nucleus.pyknotic)),
            (P::CellEdge, centre(&base.cytoplasm.rim_um)),
            (P::Structure, 1.0),
            (P::FineTexture, 1.0),
            (P::Cells, counts),
            (P::Superficial, superficial / (superficial + intermediate).max(1e-9)),
            (P::Lesion, lesions / counts.max(1e-9)),
            (P::Size, of_first(base, P::Size)),
            (P::SizeVariation, of_first(base, P::SizeVariation)),
            (P::NucleusSize, of_first(base, P::NucleusSize)),
            (P::Degeneration, centre(&base.cytoplasm.degeneration)),
            (P::ClusterRadius, radius),
            (P::Outside, outside),
            (P::Leukocytes, density(&debris.leukocytes.clusters, area)),
            (P::Bacilli, density(&debris.bacilli.clusters, area)),
            (P::Speckles, density(&debris.speckles.count, area)),
            (P::Smudges, density(&debris.smudges.count, area)),
            (P::Dirt, density(&debris.dirt.clusters, area)),
            (P::BackgroundTexture, centre(&base.background.texture)),
        ] {
            values.set(parameter, value);
        }
        values
    }
}

/// Returns the recipe of a setting with the values of `fitted` parameters. The others have the values of the initial
/// recipe.
#[must_use]
pub fn recipe(setting: &Setting, values: &Values, fitted: impl Fn(P) -> bool) -> Recipe {
    let on = |parameter: P| setting.seeks(parameter) && fitted(parameter);
    let get = |parameter: P| values.get(parameter);
    let base = setting.base_values();
    let pixel_um = if on(P::Pixel) { get(P::Pixel) } else { setting.pixel_um };
    let mut r = setting.base.clone();
    let [width, height] = setting.size_px.map(|side| side as f64);
    r.field.width_px = width.into();
    r.field.height_px = height.into();
    r.field.pixel_um = number(pixel_um);
    r.field.magnification = 0.0.into();
    r.camera.bits = f64::from(setting.bits).into();
    if setting.extended && r.focus.output != FocusOutput::Edf {
        r.focus = Preset::ExtendedFocus.recipe().focus;
    } else if !setting.extended {
        r.focus.output = FocusOutput::Planes;
        r.focus.planes = 1.0.into();
    }
    let or_base = |parameter: P| if on(parameter) { get(parameter) } else { base.get(parameter) };
    let sd = |parameter: P| values.spread(parameter);

    if on(P::Level) {
        let level = get(P::Level) + TEXTURE_LOSS * or_base(P::BackgroundTexture);
        // The mean of the empty slide is at most the highest grey level. Brighter fields would have no noise.
        let highest = rounded(P::Level.prior().high + TEXTURE_LOSS * or_base(P::BackgroundTexture));
        r.background.level = cut(normal(level, sd(P::Level)), 0.05, highest);
    }
    if on(P::FalloffX) || on(P::FalloffY) {
        let centre_offset = match &r.background.illumination {
            Illumination::Quadratic(Quadratic { centre_offset, .. }) => centre_offset.clone(),
            Illumination::Border(_) => 0.0.into(),
        };
        r.background.illumination = Illumination::Quadratic(Quadratic {
            falloff_x: cut(normal(or_base(P::FalloffX), sd(P::FalloffX)), 0.0, 0.45),
            falloff_y: cut(normal(or_base(P::FalloffY), sd(P::FalloffY)), 0.0, 0.45),
            centre_offset,
        });
    }
    camera(&mut r, sd(P::Noise), &on, &or_base);
    if on(P::Blur) {
        *blur(&mut r.optics) = cut(log_normal(get(P::Blur), sd(P::Blur)), 0.0, 10.0);
    }
    if on(P::StrayLight)
        && let Some(fraction) = stray_light(&mut r.optics)
    {
        *fraction = cut(normal(get(P::StrayLight), sd(P::StrayLight)), 0.0, 0.5);
    }
    let stain = &mut r.stain;
    for (parameter, of_field, of_slide) in [
        (P::FieldCytoplasm, &mut stain.field_cytoplasm, Some(&mut stain.slide_cytoplasm)),
        (P::FieldNucleus, &mut stain.field_nucleus, Some(&mut stain.slide_nucleus)),
        (P::Texture, &mut stain.field_texture, None),
    ] {
        if on(parameter) {
            *of_field = cut(log_normal(get(parameter), sd(parameter)), 0.0, 20.0);
            // Each real field counts as one slide, so the variation between fields includes that between slides.
            of_slide.into_iter().for_each(|slide| *slide = 1.0.into());
        }
    }
    if on(P::Pyknotic) {
        r.nucleus.pyknotic = number(get(P::Pyknotic));
    }
    if on(P::Structure) {
        let factor = get(P::Structure);
        let cytoplasm = &mut r.cytoplasm;
        // In fields with much structure, cells have more dark specks rather than much stronger clouds.
        for (number, factor, most) in [
            (&mut cytoplasm.specks, factor, 1000.0),
            (&mut cytoplasm.flecks, factor, 5.0),
            (&mut cytoplasm.clouds, factor.sqrt(), 2.0),
            (&mut cytoplasm.cytoskeleton, factor.sqrt(), 2.0),
        ] {
            *number = cut(times(number, factor), 0.0, most);
        }
    }
    if on(P::FineTexture) {
        r.cytoplasm.texture = cut(times(&r.cytoplasm.texture, get(P::FineTexture)), 0.0, 20.0);
    }
    cells(&mut r, &setting.base, values, &on, &or_base);
    // Returns the distribution for a value and the initial distribution.
    type Spread = fn(f64, &Number) -> Number;
    let mut single: Vec<(P, &mut Number, Spread)> = vec![
        (P::BackgroundTexture, &mut r.background.texture, |value, _| number(value)),
        (P::NoiseCorrelationX, &mut r.focus.noise_correlation_x, |value, _| number(value.clamp(0.0, 0.5))),
        (P::NoiseCorrelationY, &mut r.focus.noise_correlation_y, |value, _| number(value.clamp(0.0, 0.5))),
        (P::Depth, &mut r.slide.depth_um, |value, _| number(value)),
        (P::CellEdge, &mut r.cytoplasm.rim_um, |value, like| cut(about(value, like), 0.0, 10.0)),
        (P::Degeneration, &mut r.cytoplasm.degeneration, |value, like| cut(about(value, like), 0.0, 5.0)),
        (P::CytoplasmVariation, &mut r.stain.cytoplasm_variation, |value, _| number(value)),
        (P::NucleusVariation, &mut r.stain.nucleus_variation, |value, _| number(value)),
        (P::Dome, &mut r.nucleus.dome, |value, _| within(value, 0.2)),
        (P::Rim, &mut r.nucleus.rim, |value, _| Number::uniform(0.0, rounded(2.0 * value))),
        (P::Edge, &mut r.nucleus.edge_um, |value, _| within(value, (EDGES * value).max(0.1))),
        (P::Clumping, &mut r.nucleus.clumping, |value, _| within(value, 0.2)),
    ];
    if let Layout::Clusters(Clusters { radius_um, outside, .. }) = &mut r.layout {
        single.push((P::ClusterRadius, radius_um, about));
        single.push((P::Outside, outside, |value, _| number(value)));
    }
    for (parameter, field, made) in single.into_iter().filter(|(parameter, ..)| on(*parameter)) {
        *field = made(get(parameter), field);
    }
    let debris = &mut r.debris;
    for (parameter, count) in [
        (P::Leukocytes, &mut debris.leukocytes.clusters),
        (P::Bacilli, &mut debris.bacilli.clusters),
        (P::Speckles, &mut debris.speckles.count),
        (P::Smudges, &mut debris.smudges.count),
        (P::Dirt, &mut debris.dirt.clusters),
    ] {
        *count = if on(parameter) {
            Abundance::per_mm2(cut(log_normal(get(parameter), sd(parameter)), 0.0, 2.0 * parameter.prior().high))
        } else {
            per_mm2(count, base_area(&setting.base), 1.0)
        };
    }
    r
}

/// Returns the recipe of several fields, each with a condition of its own. `mean` has the values that all fields share.
#[must_use]
pub(crate) fn matched(setting: &Setting, mean: &Values, fields: &[Values], fitted: impl Fn(P) -> bool) -> Recipe {
    let mut all = recipe(setting, mean, &fitted);
    // Each real field counts as one slide.
    all.slide.fields_per_slide = 1;
    let plain = all.clone();
    let condition =
        |values: &Values| Condition { weight: 1.0, numbers: recipe(setting, values, &fitted).numbers_unlike(&plain) };
    all.conditions = fields.iter().map(condition).collect();
    all
}

/// Classes of cells whose fraction is sought.
const PAIR: [&str; 2] = ["superficial", "intermediate"];

/// Classes of lesions.
const LESIONS: [&str; 7] = ["ascus", "lsil", "moderate", "severe", "carcinoma-in-situ", "high-grade", "carcinoma"];

fn lesions(recipe: &Recipe) -> impl Iterator<Item = &CellMix> {
    recipe.cells.iter().filter(|(class, _)| LESIONS.contains(&class.as_str())).map(|(_, mix)| mix)
}

/// Returns the numbers of cells of the classes of [`PAIR`].
fn of_pair(recipe: &Recipe) -> [f64; 2] {
    let area = base_area(recipe);
    PAIR.map(|class| recipe.cells.get(class).map_or(0.0, |mix| density(&mix.count, area)))
}

/// Returns a factor on sizes of the first class of cells.
fn of_first(base: &Recipe, parameter: P) -> f64 {
    base.cells.values().next().map_or(1.0, |mix| match parameter {
        P::NucleusSize => centre(&mix.nucleus_size),
        P::SizeVariation => centre(&mix.size_variation),
        _ => centre(&mix.size),
    })
}

fn base_area(base: &Recipe) -> f64 {
    let [w, h, p] = [&base.field.width_px, &base.field.height_px, &base.field.pixel_um].map(centre);
    w * h * p * p * 1e-6
}

/// Returns the light of the empty slide including the subtracted glare, in grey levels after subtraction.
fn signal(level: f64, glare: f64) -> f64 {
    LEVELS * (level + glare / (1.0 - glare))
}

/// Sets photon noise, read noise and pattern noise from the noise of the empty slide.
fn camera(r: &mut Recipe, log_sd: f64, on: &impl Fn(P) -> bool, or_base: &impl Fn(P) -> f64) {
    if !(on(P::Noise) || on(P::Photons) || on(P::Pattern)) {
        return;
    }
    /// Minimum fraction of photon noise and of read noise.
    const LEAST: f64 = 0.02;
    /// Fraction of the variance of the pattern that does not depend on the light: fitted to the noise in dark nuclei of
    /// real fields.
    const ADDITIVE: f64 = 0.08;
    /// Range of the full well in recipes, electrons.
    const WELL: [f64; 2] = [10.0, 1e7];
    let glare = centre(&r.camera.glare_subtracted);
    let signal = signal(or_base(P::Level), glare);
    let all = or_base(P::Noise) * or_base(P::Noise);
    let pattern = or_base(P::Pattern).clamp(0.0, P::Pattern.prior().high) * all;
    let rest = (all - pattern - ROUNDING).max(0.1 * all);
    let photons = or_base(P::Photons).clamp(LEAST, 1.0 - LEAST);
    let per_well = LEVELS / (1.0 - glare);
    let per_dn = (signal / (photons * rest)).clamp(WELL[0] / per_well, WELL[1] / per_well);
    let read = per_dn * ((1.0 - photons) * rest).sqrt();
    let camera = &mut r.camera;
    camera.full_well_e = number(per_dn * per_well);
    // Only the read noise varies between fields.
    let spread = (log_sd / (1.0 - photons)).min(0.5);
    camera.read_noise_e = if spread > 0.02 { log_normal(read, spread) } else { number(read) };
    camera.read_noise_rms_e = 0.0.into();
    camera.dsnu_e = number(per_dn * (ADDITIVE * pattern).sqrt());
    camera.dark_current_e_per_s = 0.0.into();
    camera.prnu = number(((1.0 - ADDITIVE) * pattern).sqrt() / signal);
}

fn cells(r: &mut Recipe, base: &Recipe, values: &Values, on: &impl Fn(P) -> bool, or_base: &impl Fn(P) -> f64) {
    let found = on(P::Cells) || on(P::Superficial) || on(P::Lesion);
    let (total, share) = (or_base(P::Cells), or_base(P::Superficial));
    let area = base_area(base);
    let base_total: f64 = r.cells.values().map(|mix| density(&mix.count, area)).sum();
    let scale = total / base_total.max(1e-9);
    let pair = of_pair(base);
    let of_lesions: f64 = lesions(base).map(|mix| density(&mix.count, area)).sum();
    for (class, mix) in &mut r.cells {
        let part = if !on(P::Lesion) {
            1.0
        } else if LESIONS.contains(&class.as_str()) {
            or_base(P::Lesion) * base_total / of_lesions
        } else {
            (1.0 - or_base(P::Lesion)) * base_total / (base_total - of_lesions)
        };
        if found {
            let own = match class.as_str() {
                "superficial" if on(P::Superficial) => (pair[0] + pair[1]) * share,
                "intermediate" if on(P::Superficial) => (pair[0] + pair[1]) * (1.0 - share),
                _ => density(&mix.count, area),
            };
            let count = log_normal((own * part * scale).max(0.1), values.spread(P::Cells));
            mix.count = Abundance::per_mm2(cut(count, 0.0, 2.0 * P::Cells.prior().high));
        } else {
            mix.count = per_mm2(&mix.count, area, scale);
        }
        // Classes keep their sizes relative to each other.
        for (parameter, own, [low, high]) in [
            (P::Size, &mut mix.size, [0.1, 10.0]),
            (P::NucleusSize, &mut mix.nucleus_size, [0.1, 10.0]),
            (P::SizeVariation, &mut mix.size_variation, [0.0, 5.0]),
        ] {
            if on(parameter) {
                let before = of_first(base, parameter);
                *own = if before > 0.0 { times(own, or_base(parameter) / before) } else { number(or_base(parameter)) };
                *own = cut(own.clone(), low, high);
            }
        }
    }
}

fn blur(optics: &mut Optics) -> &mut Number {
    match optics {
        Optics::BrightField(Microscope { extra_blur_um, .. }) => extra_blur_um,
        Optics::Gaussian(Gaussians { sigma_xy_um, .. }) => sigma_xy_um,
    }
}

/// Returns the stray light of bright-field optics.
fn stray_light(optics: &mut Optics) -> Option<&mut Number> {
    match optics {
        Optics::BrightField(Microscope { stray_light, .. }) => Some(stray_light),
        Optics::Gaussian(_) => None,
    }
}

/// Rounds to significant digits.
pub(crate) fn rounded_to(value: f64, digits: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let scale = libm::pow(10.0, f64::from(digits) - libm::ceil(libm::log10(value.abs())));
    libm::round(value * scale) / scale
}

/// Rounds to the digits of recipes.
fn rounded(value: f64) -> f64 {
    rounded_to(value, 4)
}

fn number(value: f64) -> Number {
    Number::Fixed(rounded(value))
}

fn normal(mean: f64, sd: f64) -> Number {
    if rounded(sd) > 0.0 { Number::normal(rounded(mean), rounded(sd)) } else { number(mean) }
}

fn log_normal(median: f64, log_sd: f64) -> Number {
    if rounded(log_sd) > 0.0 { Number::log_normal(rounded(median), rounded(log_sd)) } else { number(median) }
}

/// Returns a uniform distribution around a value, within 0 to 1.
fn within(middle: f64, half: f64) -> Number {
    let half = half.min(middle.max(0.0)).min((1.0 - middle).max(0.0));
    if half > 0.0 {
        Number::uniform(rounded(middle - half), rounded(middle + half))
    } else {
        number(middle.clamp(0.0, 1.0))
    }
}

/// Truncates a distribution to the accepted range if it exceeds the range.
fn cut(number: Number, low: f64, high: f64) -> Number {
    let [least, most] = number.bounds();
    let number = if least < low { number.at_least(low) } else { number };
    if most > high { number.at_most(high) } else { number }
}

/// Scales a distribution to another centre.
fn about(middle: f64, like: &Number) -> Number {
    let now = centre(like);
    if now > 0.0 { times(like, middle / now) } else { number(middle) }
}

/// Multiplies a distribution by a factor.
pub(crate) fn times(number: &Number, factor: f64) -> Number {
    let by = |value: &f64| rounded(value * factor);
    match number {
        Number::Fixed(value) => Number::Fixed(by(value)),
        Number::Drawn { distribution, min, max } => Number::Drawn {
            distribution: match distribution {
                Distribution::Uniform(a, b) => Distribution::Uniform(by(a), by(b)),
                Distribution::Normal(a, b) => Distribution::Normal(by(a), by(b)),
                Distribution::LogNormal(median, log_sd) => Distribution::LogNormal(by(median), *log_sd),
                Distribution::Choice(values) => Distribution::Choice(values.iter().map(by).collect()),
            },
            min: if min.is_finite() { by(min) } else { *min },
            max: if max.is_finite() { by(max) } else { *max },
        },
    }
}

/// Returns the centre of a density per mm², or of a count divided by the area of a field.
fn density(abundance: &Abundance, area: f64) -> f64 {
    centre(abundance.number()) / if abundance.is_density() { 1.0 } else { area }
}

/// Returns a density per mm², multiplied by a factor; a count is divided by the area of a field.
fn per_mm2(abundance: &Abundance, area: f64, factor: f64) -> Abundance {
    Abundance::per_mm2(times(abundance.number(), factor / if abundance.is_density() { 1.0 } else { area }))
}

/// Returns the centre of a distribution: the median of a log-normal one, the mean of others.
pub(crate) fn centre(number: &Number) -> f64 {
    match number {
        Number::Fixed(value) => *value,
        Number::Drawn { distribution, .. } => match distribution {
            Distribution::Uniform(a, b) => 0.5 * (a + b),
            Distribution::Normal(mean, _) => *mean,
            Distribution::LogNormal(median, _) => *median,
            Distribution::Choice(values) => values.iter().sum::<f64>() / values.len().max(1) as f64,
        },
    }
}

/// Returns the parameters that are found by simulation.
pub(crate) fn simulated(setting: &Setting) -> Vec<P> {
    PARAMETERS.into_iter().filter(|p| setting.seeks(*p) && p.prior().source == Source::Simulated).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn setting(extended: bool) -> Setting {
        Setting { base: Recipe::default(), size_px: [640, 480], pixel_um: 0.33, bits: 8, extended, seek_pixel: false }
    }

    #[test]
    fn recipes_at_the_limits_of_all_ranges_are_valid() {
        for preset in Preset::ALL {
            let setting = Setting { base: preset.recipe(), ..setting(true) };
            for place in [0.0, 0.5, 1.0] {
                let values = Values::at(&[place; PARAMETERS.len()]);
                let problems = recipe(&setting, &values, |_| true).problems();
                assert!(problems.is_empty(), "{preset:?} at {place}: {problems:?}");
            }
            let mut faint = Values::at(&[0.5; PARAMETERS.len()]);
            [P::Noise, P::Photons].into_iter().for_each(|parameter| faint.set(parameter, parameter.prior().low));
            let problems = recipe(&setting, &faint, |_| true).problems();
            assert!(problems.is_empty(), "{preset:?} with faint noise: {problems:?}");
            for parameter in PARAMETERS {
                let values = Values::at(&[0.9; PARAMETERS.len()]);
                let problems = recipe(&setting, &values, |p| p == parameter).problems();
                assert!(problems.is_empty(), "{preset:?}, {parameter:?}: {problems:?}");
            }
        }
    }

    #[test]
    fn stray_light_is_sought_in_bright_field_optics_only() {
        let mut setting = setting(true);
        assert!(setting.seeks(P::StrayLight));
        let values = Values::at(&[0.5; PARAMETERS.len()]);
        setting.base.optics = Optics::Gaussian(Gaussians::default());
        assert!(!setting.seeks(P::StrayLight));
        assert!(matches!(recipe(&setting, &values, |_| true).optics, Optics::Gaussian(_)));
    }

    #[test]
    fn the_light_of_no_field_exceeds_the_highest_grey_level() {
        let mut values = Values::at(&[0.5; PARAMETERS.len()]);
        values.set(P::Level, P::Level.prior().high);
        values.set_spread(P::Level, 0.2);
        let made = recipe(&setting(true), &values, |_| true);
        let brightest = made.background.level.bounds()[1] - TEXTURE_LOSS * centre(&made.background.texture);
        assert!((brightest - 1.0).abs() < 1e-3, "{brightest}");
    }

    #[test]
    fn structure_changes_specks_more_than_clouds() {
        let setting = setting(true);
        let mut values = setting.base_values();
        values.set(P::Structure, 4.0);
        let (base, made) = (&setting.base.cytoplasm, recipe(&setting, &values, |_| true).cytoplasm);
        for (before, after, factor) in [
            (&base.specks, &made.specks, 4.0),
            (&base.flecks, &made.flecks, 4.0),
            (&base.clouds, &made.clouds, 2.0),
            (&base.cytoskeleton, &made.cytoskeleton, 2.0),
        ] {
            assert!((centre(after) / centre(before) - factor).abs() < 0.01 * factor, "{before:?}: {after:?}");
        }
    }

    #[test]
    fn values_of_a_recipe_are_read_back() {
        let mut setting = setting(true);
        // A recipe without degenerated cells keeps them out.
        setting.base.cytoplasm.degeneration = 0.2.into();
        let values = Values::at(&std::array::from_fn(|i| 0.2 + 0.6 * (i as f64) / PARAMETERS.len() as f64));
        let made = recipe(&setting, &values, |_| true);
        let back = Setting { base: made, ..setting }.base_values();
        for parameter in
            PARAMETERS.into_iter().filter(|p| !matches!(p, P::Pixel | P::Structure | P::FineTexture | P::Lesion))
        {
            let (a, b) = (values.get(parameter), back.get(parameter));
            assert!((a - b).abs() < 0.03 * a.abs() + 0.01, "{parameter:?}: {a} {b}");
        }
    }
}
