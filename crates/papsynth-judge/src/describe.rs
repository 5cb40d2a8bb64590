//! Features and statistics in words.

/// Returns a description of a feature of [`FeatureTable`](crate::FeatureTable), of a statistic of
/// [`Statistics::scalars`](crate::Statistics::scalars) or of a descriptor of [`Moments`](crate::Moments); other names
/// are returned as they are.
///
/// ```
/// use papsynth_judge::describe;
///
/// assert_eq!(describe("nucleus area, um2"), "nuclear area, µm²");
/// assert_eq!(describe("log power at 2 px"), "power at 0.09–0.19 cycles/px, log10");
/// ```
#[must_use]
pub fn describe(name: &str) -> String {
    let fixed = FIXED.iter().find(|(key, _)| *key == name).map(|(_, text)| (*text).to_owned());
    fixed.or_else(|| numbered(name)).unwrap_or_else(|| name.to_owned())
}

/// Descriptions of names without a number.
const FIXED: [(&str, &str); 89] = [
    // Nuclei.
    ("nucleus area, um2", "nuclear area, µm²"),
    ("nucleus eccentricity", "elongation of the nucleus (0 for a circle)"),
    ("nucleus solidity", "nuclear area over that of its convex hull"),
    ("nucleus circularity", "roundness of the nucleus (1 for a circle)"),
    ("nucleus outline roughness", "irregularity of the nuclear outline"),
    ("core absorbance", "mean absorbance of the nucleus"),
    ("core above surroundings", "absorbance of the nucleus above its surroundings"),
    ("absorbance beside", "absorbance around the nucleus (0.8–2.5 µm)"),
    ("absorbance further out less beside", "absorbance 2.5–5 µm from the nucleus minus that at 0.8–2.5 µm"),
    ("spread beside", "standard deviation of absorbance around the nucleus"),
    ("unevenness around", "variation of absorbance with direction around the nucleus"),
    ("core sd", "contrast of chromatin (standard deviation)"),
    ("core sd over contrast", "contrast of chromatin over that of the nucleus"),
    ("core skewness", "skewness of absorbance in the nucleus"),
    ("core kurtosis", "kurtosis of absorbance in the nucleus"),
    ("core dark tail", "darkest chromatin (percentile 95 above the median, in sd)"),
    ("core pale tail", "palest chromatin (percentile 5 below the median, in sd)"),
    ("rim sigma, px", "blur of the nuclear border, px"),
    ("darkest depth over core", "darkness of the nuclear membrane over the inside"),
    ("rim slope over contrast", "steepness of the nuclear border"),
    ("rim unevenness", "variation of steepness along the nuclear border"),
    ("core sd without trend", "contrast of chromatin without gradients"),
    ("core slope", "mean gradient of absorbance in the nucleus"),
    ("core slope over sd", "fineness of chromatin (gradient over contrast)"),
    ("dark spots, um-2", "dark spots per µm² of nucleus"),
    ("pale spots, um-2", "pale spots per µm² of nucleus"),
    ("entropy, bits", "entropy of grey levels in the nucleus, bits"),
    // Free cells.
    ("cell area, um2", "cell area, µm²"),
    ("cell eccentricity", "elongation of the cell (0 for a circle)"),
    ("cell solidity", "cell area over that of its convex hull"),
    ("cell circularity", "roundness of the cell (1 for a circle)"),
    ("corners", "corners of the cell outline"),
    ("notches", "notches of the cell outline"),
    ("straight part of the outline", "straight fraction of the cell outline"),
    ("nucleus over cell area", "nuclear area over cell area"),
    ("nucleus off centre, radii", "distance of the nucleus from the cell centre, cell radii"),
    ("cytoplasm absorbance", "median absorbance of the cytoplasm"),
    ("cytoplasm sd over median", "contrast of the cytoplasm over its absorbance"),
    ("cytoplasm slope over median", "mean gradient of the cytoplasm over its absorbance"),
    ("dark spots in cytoplasm, um-2", "dark spots per µm² of cytoplasm"),
    ("pale spots in cytoplasm, um-2", "pale spots per µm² of cytoplasm"),
    ("unevenness between sectors", "variation of absorbance with direction in the cell"),
    ("darkest sector over median", "absorbance of the darkest sector over that of the cell"),
    ("steep part of the rim", "steep fraction of the cell border"),
    // Windows inside cells.
    ("cytoplasm skewness at 1 px", "asymmetry of the texture of cytoplasm at 1 px"),
    ("cytoplasm skewness at 2 px", "asymmetry of the texture of cytoplasm at 2 px"),
    ("cytoplasm skewness at 4 px", "asymmetry of the texture of cytoplasm at 4 px"),
    ("cytoplasm kurtosis at 1 px", "sparseness of the texture of cytoplasm at 1 px (kurtosis)"),
    ("cytoplasm kurtosis at 2 px", "sparseness of the texture of cytoplasm at 2 px (kurtosis)"),
    ("cytoplasm kurtosis at 4 px", "sparseness of the texture of cytoplasm at 4 px (kurtosis)"),
    ("cytoplasm correlation of 1 with 2 px", "coincidence of details of 1 and 2 px in cytoplasm"),
    ("cytoplasm correlation of 2 with 4 px", "coincidence of details of 2 and 4 px in cytoplasm"),
    // Patches.
    ("log slope across over down", "horizontal over vertical gradient, log10"),
    ("log noise, dn", "noise of the flattest areas, grey levels of 255, log10"),
    ("noise correlation 1 across", "correlation of noise with the pixel to the right"),
    ("noise correlation 1 down", "correlation of noise with the pixel below"),
    ("noise correlation 1 diagonally", "correlation of noise with the pixel below right"),
    ("noise correlation 2 across", "correlation of noise with the second pixel to the right"),
    ("noise correlation 2 down", "correlation of noise with the second pixel below"),
    // Fields.
    ("background, dn", "light of the empty slide, grey levels of 255"),
    ("background, peak to valley", "variation of the light over the field, fraction"),
    ("background, curvature across", "horizontal curvature of the light (negative: darker borders)"),
    ("background, curvature down", "vertical curvature of the light (negative: darker borders)"),
    ("noise, dn", "noise of the empty slide, grey levels of 255"),
    ("noise correlation across", "correlation of noise with the pixel to the right"),
    ("noise correlation down", "correlation of noise with the pixel below"),
    ("noise correlation diagonally", "correlation of noise with the pixel below right"),
    ("coverage", "fraction of the field covered by cells and debris"),
    ("absorbance of what is covered", "median absorbance of the covered area without nuclei"),
    ("its 90th over its 10th percentile", "percentile 90 over percentile 10 of the absorbance of the covered area"),
    ("part of it in layers", "fraction of the covered area where cells overlap"),
    ("slope of the spectrum", "exponent of the power spectrum of absorbance"),
    ("edge sigma p10, px", "blur of the sharpest edges, px"),
    ("edge sigma p50, px", "median blur of edges, px"),
    ("nuclei a mm2", "nuclei per mm²"),
    ("Clark-Evans", "distance to the nearest nucleus over that at random (below 1: clustered)"),
    ("K over Poisson at 16.5 um", "clustering of nuclei within 16.5 µm (1: random)"),
    ("K over Poisson at 33 um", "clustering of nuclei within 33 µm (1: random)"),
    ("K over Poisson at 66 um", "clustering of nuclei within 66 µm (1: random)"),
    ("K over Poisson at 99 um", "clustering of nuclei within 99 µm (1: random)"),
    ("area of nuclei, um2", "median nuclear area, µm²"),
    ("area of free cells, um2", "median area of free cells, µm²"),
    ("circularity of free cells", "median roundness of free cells (1 for a circle)"),
    ("solidity of free cells", "median area of free cells over that of their convex hulls"),
    ("corners of free cells", "mean number of corners of free cells"),
    ("straight part of their outline", "median straight fraction of the outlines of free cells"),
    // Moments.
    ("log moment 2", "variance of grey levels in the nucleus, log10"),
    ("log moment 3", "asymmetry of grey levels in the nucleus (third moment), log10"),
    ("log moment 4", "fourth moment of grey levels in the nucleus, log10"),
];

/// Returns the number after a prefix, if only a suffix follows it.
fn between<'a>(name: &'a str, prefix: &str, suffix: &str) -> Option<&'a str> {
    name.strip_prefix(prefix)?.strip_suffix(suffix)
}

fn numbered(name: &str) -> Option<String> {
    let of = |prefix: &str, suffix: &str| between(name, prefix, suffix);
    if let Some(bin) = of("rim to centre, bin ", " of 5") {
        return Some(format!("relative absorbance of the nucleus, ring {bin} of 5 from border to centre"));
    }
    if let Some(bin) = of("rim to centre, bin ", " of 10") {
        return Some(format!("relative absorbance of the cytoplasm, ring {bin} of 10 from border to centre"));
    }
    if let Some(px) = of("core correlation down less across at ", " px") {
        return Some(format!("vertical minus horizontal correlation of chromatin at {px} px"));
    }
    if let Some(px) = of("core correlation at ", " px") {
        return Some(format!("correlation of chromatin at {px} px"));
    }
    if let Some(px) = of("core power at ", " px") {
        return Some(format!("contrast of chromatin at {}", cycles(px)?));
    }
    if let Some(px) = of("cytoplasm power at ", " px over median") {
        return Some(format!("contrast of the cytoplasm at {}", cycles(px)?));
    }
    if let Some(range) = of("cytoplasm power at ", " cycles/px") {
        return Some(format!("power inside cells at {} cycles/px, ln", range.replace('-', "–")));
    }
    if let Some(q) = of("cytoplasm quantile ", " over median") {
        return Some(format!("absorbance of the cytoplasm over its median, {}", percentile(q)?));
    }
    if let Some(q) = of("sigma of the cell's rim, px, quantile ", "") {
        return Some(format!("blur of the cell border, px, {}", percentile(q)?));
    }
    if let Some(n) = of("log moment ", "") {
        return Some(format!("central moment {n} of grey levels in the nucleus, log10"));
    }
    patch(name)
}

fn patch(name: &str) -> Option<String> {
    let of = |prefix: &str, suffix: &str| between(name, prefix, suffix);
    if let Some(q) = of("absorbance, quantile ", "") {
        return Some(format!("absorbance, {}", percentile(q)?));
    }
    if let Some(a) = of("part of absorbance ", " and more") {
        return Some(format!("fraction of the patch in the absorbance range from {a}"));
    }
    if let Some((px, finer)) = of("log power at ", " px").and_then(|both| both.split_once(" over ")) {
        return Some(format!("power at {} over that at {}, log10", cycles(px)?, cycles(finer)?));
    }
    if let Some(px) = of("log power at ", " px") {
        return Some(format!("power at {}, log10", cycles(px)?));
    }
    if let Some(px) = of("sparseness at ", " px") {
        return Some(format!("sparseness of details at {}", cycles(px)?));
    }
    if let Some(q) = of("log slope, quantile ", "") {
        return Some(format!("gradient of absorbance, {}, log10", percentile(q)?));
    }
    if let Some(q) = of("edge sigma, px, quantile ", "") {
        return Some(format!("blur of edges, px, {}", percentile(q)?));
    }
    if let Some(px) = of("log dark ridges at ", " px") {
        return Some(format!("strength of dark lines at scale {px} px, log10"));
    }
    if let Some(px) = of("pale over dark ridges at ", " px") {
        return Some(format!("pale lines over dark lines at scale {px} px"));
    }
    if let Some(px) = of("blobs over ridges at ", " px") {
        return Some(format!("spots over lines at scale {px} px"));
    }
    if let Some(px) = of("coherence at ", " px") {
        return Some(format!("alignment of structures at scale {px} px (1: parallel)"));
    }
    if let Some(px) = of("coherence of edges at ", " px") {
        return Some(format!("alignment of edges at scale {px} px (1: parallel)"));
    }
    let (class, px) = of("pattern ", " px")?.split_once(" at ")?;
    Some(match class {
        "9" => format!("fraction of pixels with irregular neighbours at {px} px"),
        _ => format!("fraction of pixels with {class} of 8 darker neighbours at {px} px"),
    })
}

/// Frequencies of a band: from half amplitude of a Gaussian of `px` pixels to that of the next finer one.
fn cycles(px: &str) -> Option<String> {
    /// √(ln 2 / 2) / π.
    const HALF: f64 = 0.1874;
    let px: f64 = px.parse().ok()?;
    let high = if px > 1.0 { 2.0 * HALF / px } else { 0.5 };
    let digits = if px > 4.0 { 3 } else { 2 };
    Some(format!("{:.digits$}–{high:.digits$} cycles/px", HALF / px))
}

fn percentile(q: &str) -> Option<String> {
    let q: f64 = q.parse().ok()?;
    Some(format!("percentile {}", (1000.0 * q).round() / 10.0))
}
