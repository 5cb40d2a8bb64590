//! Draws the absorbance spectra of the dyes, and the weights of the colour channels, as SVG. Optional argument: the
//! output path.

use std::error::Error;
use std::fmt::Write;

use dye_spectra::{Colour, ColourParams, Dye};

/// Size of a panel and place of the first one, px.
const PANEL: [f64; 2] = [640.0, 190.0];
const LEFT: f64 = 48.0;
const TOP: f64 = 16.0;
/// Place of the second panel, px.
const SECOND: f64 = 230.0;
/// Height of the second panel, px.
const LOW: f64 = 90.0;
/// Wavelengths of the axis, nm.
const FROM_NM: u32 = 400;
const TO_NM: u32 = 700;

const DYES: [(Dye, &str, &str); 4] = [
    (Dye::Haematein, "haematein", "#6a3d9a"),
    (Dye::EosinY, "eosin Y", "#e377a2"),
    (Dye::LightGreen, "light green", "#2a9d8f"),
    (Dye::OrangeG, "orange G", "#e98b24"),
];
const CHANNELS: [&str; 3] = ["#c33", "#393", "#36c"];

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/spectra.svg".to_owned());
    let mut svg =
        String::from("<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 820 372' font-family='sans-serif' ");
    svg += "font-size='14'>\n<rect width='100%' height='100%' fill='white'/>\n";
    for (value, y) in [(0.0, TOP + PANEL[1]), (0.5, TOP + 0.5 * PANEL[1]), (1.0, TOP)] {
        writeln!(svg, "<path d='M{LEFT} {y}h{}' stroke='#ccc'/>", PANEL[0])?;
        writeln!(svg, "<text x='{}' y='{}' text-anchor='end'>{value}</text>", LEFT - 6.0, y + 5.0)?;
    }
    for (number, (dye, name, colour)) in DYES.into_iter().enumerate() {
        let curve = (FROM_NM..=TO_NM)
            .step_by(2)
            .map(|nm| [place(f64::from(nm)), TOP + PANEL[1] * (1.0 - dye.absorbance(f64::from(nm) / 1000.0))]);
        polyline(&mut svg, curve, colour)?;
        let y = TOP + 20.0 * (number + 1) as f64;
        writeln!(svg, "<text x='{}' y='{y}' fill='{colour}'>{name}</text>", LEFT + PANEL[0] + 16.0)?;
    }
    // Weights relative to the largest of all channels.
    let colour = Colour::new(&ColourParams::default())?;
    let largest =
        colour.channels().iter().flat_map(|channel| &channel.nodes).map(|node| node.weight).fold(0.0, f64::max);
    for (channel, colour) in colour.channels().iter().zip(CHANNELS) {
        let place = |um: f64, weight: f64| [place(1000.0 * um), SECOND + LOW * (1.0 - weight / largest)];
        polyline(&mut svg, channel.nodes.iter().map(|node| place(node.wavelength_um, node.weight)), colour)?;
    }
    let bottom = SECOND + LOW;
    writeln!(svg, "<text x='{}' y='{}'>camera</text>", LEFT + PANEL[0] + 16.0, SECOND + 0.5 * LOW)?;
    writeln!(svg, "<g text-anchor='middle'><path d='M{LEFT} {bottom}h{}' stroke='#ccc'/>", PANEL[0])?;
    for nm in (FROM_NM..=TO_NM).step_by(50) {
        let x = place(f64::from(nm));
        writeln!(
            svg,
            "<path d='M{x:.1} {bottom}v5' stroke='#333'/><text x='{x:.1}' y='{}'>{nm}</text>",
            bottom + 20.0
        )?;
    }
    writeln!(svg, "<text x='{}' y='{}'>wavelength, nm</text></g>", LEFT + 0.5 * PANEL[0], bottom + 42.0)?;
    std::fs::write(path, svg + "</svg>\n")?;
    Ok(())
}

/// Returns the place of a wavelength on the axis.
fn place(nm: f64) -> f64 {
    LEFT + PANEL[0] * (nm - f64::from(FROM_NM)) / f64::from(TO_NM - FROM_NM)
}

fn polyline(svg: &mut String, points: impl Iterator<Item = [f64; 2]>, colour: &str) -> std::fmt::Result {
    let points: Vec<String> = points.map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    writeln!(svg, "<polyline points='{}' fill='none' stroke='{colour}' stroke-width='2'/>", points.join(" "))
}
