//! Draws the transfer functions of the default microscope in and out of focus, as SVG. Optional argument: the output
//! path.

use std::error::Error;
use std::fmt::Write;

use optics_psf::{Microscope, MicroscopeParams, Transfer};

/// Size of a panel, and its place in the figure, px.
const PANEL: [f64; 2] = [320.0, 190.0];
const LEFT: f64 = 48.0;
const TOP: f64 = 34.0;
/// Distance between the panels, px.
const STEP: f64 = 390.0;
/// Largest frequency of the axis, cycles per µm.
const LARGEST: f64 = 2.5;
/// Points of a curve.
const POINTS: u32 = 250;

/// Depths, µm, with colour and dashes.
const DEPTHS: [(f64, &str, &str); 3] = [(0.0, "#333", ""), (2.0, "#1f77b4", ""), (-2.0, "#d62728", "6 4")];

/// A value at a frequency, cycles per µm.
type Curve = fn(&Transfer, f64) -> f64;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/transfer.svg".to_owned());
    let microscope = Microscope::new(&MicroscopeParams::default())?;
    let transfers = DEPTHS.iter().map(|(depth_um, ..)| microscope.transfer(*depth_um, 0.0));
    let transfers = transfers.collect::<Result<Vec<Transfer>, _>>()?;
    let mut svg =
        String::from("<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 780 282' font-family='sans-serif' ");
    svg += "font-size='14'>\n<rect width='100%' height='100%' fill='white'/>\n";
    let panels: [(&str, Curve); 2] = [
        ("Absorbance", |transfer, frequency| transfer.absorption([frequency, 0.0])[0]),
        ("Phase", |transfer, frequency| transfer.phase([frequency, 0.0])[0]),
    ];
    for (number, (title, value)) in panels.into_iter().enumerate() {
        axes(&mut svg, LEFT + STEP * number as f64, title)?;
        for ((_, colour, dashes), transfer) in DEPTHS.iter().zip(&transfers) {
            let points = (0..=POINTS).map(|i| LARGEST * f64::from(i) / f64::from(POINTS));
            let points = points.map(|frequency| {
                let [x, y] = place(LEFT + STEP * number as f64, frequency, value(transfer, frequency));
                format!("{x:.1},{y:.1}")
            });
            let points: Vec<String> = points.collect();
            let stroke = format!("stroke='{colour}' stroke-dasharray='{dashes}' stroke-width='2'");
            writeln!(svg, "<polyline points='{}' fill='none' {stroke}/>", points.join(" "))?;
        }
    }
    for (number, (depth_um, colour, dashes)) in DEPTHS.iter().enumerate() {
        let (x, y) = (LEFT + 220.0, TOP + 126.0 + 20.0 * number as f64);
        let stroke = format!("stroke='{colour}' stroke-dasharray='{dashes}' stroke-width='2'");
        writeln!(svg, "<path d='M{x} {y}h30' {stroke}/><text x='{}' y='{}'>{depth_um} µm</text>", x + 38.0, y + 5.0)?;
    }
    std::fs::write(path, svg + "</svg>\n")?;
    Ok(())
}

/// Returns the place of a value from −1 to 1 in a panel.
fn place(left: f64, frequency: f64, value: f64) -> [f64; 2] {
    [left + PANEL[0] * frequency / LARGEST, TOP + PANEL[1] * 0.5 * (1.0 - value)]
}

fn axes(svg: &mut String, left: f64, title: &str) -> std::fmt::Result {
    let middle = left + 0.5 * PANEL[0];
    writeln!(svg, "<g text-anchor='middle'><text x='{middle}' y='20'>{title}</text>")?;
    for frequency in [0.0, 0.5, 1.0, 1.5, 2.0, 2.5] {
        let [x, y] = place(left, frequency, -1.0);
        writeln!(svg, "<path d='M{x} {y}v5' stroke='#333'/><text x='{x}' y='{}'>{frequency}</text>", y + 20.0)?;
    }
    writeln!(svg, "<text x='{middle}' y='{}'>cycles per µm</text></g>", TOP + PANEL[1] + 42.0)?;
    for value in [-1.0, -0.5, 0.0, 0.5, 1.0] {
        let [x, y] = place(left, 0.0, value);
        writeln!(svg, "<path d='M{x} {y}h{}' stroke='#ccc'/>", PANEL[0])?;
        writeln!(svg, "<text x='{}' y='{}' text-anchor='end'>{value}</text>", x - 6.0, y + 5.0)?;
    }
    Ok(())
}
