//! Small plots as SVG, without embedded fonts.

use std::fmt::Write;

/// Colours of real and synthetic data, distinguishable with colour vision deficiency (Okabe and Ito).
pub const COLOURS: [&str; 2] = ["#0072b2", "#d55e00"];

/// Width and height of a small plot.
const SMALL: [f64; 2] = [380.0, 260.0];
const LEFT: f64 = 52.0;
const BOTTOM: f64 = 40.0;
const TOP: f64 = 24.0;
const RIGHT: f64 = 10.0;

/// A plot with axes.
#[derive(Debug, Clone)]
pub struct Plot {
    size: [f64; 2],
    x: [f64; 2],
    y: [f64; 2],
    body: String,
}

impl Plot {
    /// Returns a plot for the range of all finite values, with a margin; names are title, x axis and y axis.
    pub(crate) fn new(names: [&str; 3], x: impl Iterator<Item = f64>, y: impl Iterator<Item = f64>) -> Self {
        let [title, x_name, y_name] = names;
        Self::sized(SMALL, title, x_name, y_name, range(x), range(y))
    }

    /// Returns a plot of a size, with axes for the ranges `x` and `y`.
    #[must_use]
    pub fn sized(size: [f64; 2], title: &str, x_name: &str, y_name: &str, x: [f64; 2], y: [f64; 2]) -> Self {
        let mut plot = Self { size, x, y, body: String::new() };
        let (right, bottom) = (size[0] - RIGHT, size[1] - BOTTOM);
        plot.put(&format!(r##"<path d="M{LEFT} {TOP}V{bottom}H{right}" fill="none" stroke="#444"/>"##));
        for v in ticks(plot.x) {
            let at = plot.x(v);
            plot.put(&format!(r##"<path d="M{at:.1} {bottom}v4" stroke="#444"/><text x="{at:.1}" y="{:.1}" text-anchor="middle">{}</text>"##, bottom + 15.0, short(v)));
        }
        for v in ticks(plot.y) {
            let at = plot.y(v);
            plot.put(&format!(r##"<path d="M{LEFT} {at:.1}h-4" stroke="#444"/><text x="{:.1}" y="{:.1}" text-anchor="end">{}</text>"##, LEFT - 6.0, at + 3.5, short(v)));
        }
        plot.put(&format!(r#"<text class="title" x="{LEFT}" y="14">{}</text>"#, escape(title)));
        plot.put(&format!(r#"<text x="{right}" y="{:.1}" text-anchor="end">{}</text>"#, size[1] - 6.0, escape(x_name)));
        plot.put(&format!(
            r#"<text x="12" y="{TOP}" text-anchor="end" transform="rotate(-90 12 {TOP})">{}</text>"#,
            escape(y_name)
        ));
        plot
    }

    fn put(&mut self, element: &str) {
        self.body.push_str(element);
    }

    fn x(&self, v: f64) -> f64 {
        LEFT + (v - self.x[0]) / (self.x[1] - self.x[0]) * (self.size[0] - LEFT - RIGHT)
    }

    fn y(&self, v: f64) -> f64 {
        let [_, height] = self.size;
        height - BOTTOM - (v - self.y[0]) / (self.y[1] - self.y[0]) * (height - BOTTOM - TOP)
    }

    fn path(&self, points: impl Iterator<Item = [f64; 2]>) -> String {
        let mut path = String::new();
        let mut letter = 'M';
        for point in points {
            if known(&point) {
                let _ = write!(path, "{letter}{:.1} {:.1}", self.x(point[0]), self.y(point[1]));
                letter = 'L';
            } else {
                letter = 'M';
            }
        }
        path
    }

    /// Draws a line through points, interrupted at points that are not finite.
    pub fn line(&mut self, points: impl Iterator<Item = [f64; 2]>, colour: &str) {
        let path = self.path(points);
        self.put(&format!(r#"<path d="{path}" fill="none" stroke="{colour}" stroke-width="1.8"/>"#));
    }

    /// Fills the area between two lines.
    pub fn band(&mut self, lower: &[[f64; 2]], upper: &[[f64; 2]], colour: &str) {
        let path = self.path(lower.iter().chain(upper.iter().rev()).copied().filter(known));
        self.put(&format!(r#"<path d="{path}Z" fill="{colour}" fill-opacity="0.15" stroke="none"/>"#));
    }

    /// Draws a dot at each point.
    pub fn dots(&mut self, points: impl Iterator<Item = [f64; 2]>, colour: &str) {
        self.circles(points, &format!(r#"fill="{colour}" fill-opacity="0.7""#));
    }

    /// Draws a ring at each point.
    pub fn rings(&mut self, points: impl Iterator<Item = [f64; 2]>, colour: &str) {
        self.circles(points, &format!(r#"fill="none" stroke="{colour}""#));
    }

    fn circles(&mut self, points: impl Iterator<Item = [f64; 2]>, style: &str) {
        for [x, y] in points.filter(known) {
            let (x, y) = (self.x(x), self.y(y));
            self.put(&format!(r#"<circle cx="{x:.1}" cy="{y:.1}" r="2.6" {style}/>"#));
        }
    }

    /// Draws a dashed line between two points.
    pub fn dashes(&mut self, from: [f64; 2], to: [f64; 2]) {
        let path = self.path([from, to].into_iter());
        self.put(&format!(r##"<path d="{path}" stroke="#888" stroke-dasharray="4 3"/>"##));
    }

    /// Returns the plot for an HTML page, whose style sheet sets the fonts.
    #[must_use]
    pub fn finish(self) -> String {
        let [width, height] = self.size;
        format!(
            r#"<svg viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img">{}</svg>"#,
            self.body
        )
    }

    /// Returns the plot as an SVG file.
    #[must_use]
    pub fn document(self) -> String {
        let [width, height] = self.size;
        let style = "text{font:12px sans-serif;fill:#444}.title{font-weight:600}";
        format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}"><style>{style}</style><rect width="100%" height="100%" fill="#fff"/>{}</svg>
"##,
            self.body
        )
    }
}

fn known(point: &[f64; 2]) -> bool {
    point.iter().all(|v| v.is_finite())
}

fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let [low, high] =
        values.filter(|v| v.is_finite()).fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)]);
    if low > high {
        return [0.0, 1.0];
    }
    let room = if high > low { 0.04 * (high - low) } else { 0.5 * high.abs().max(1.0) };
    [low - room, high + room]
}

/// Returns round numbers in a range.
fn ticks([low, high]: [f64; 2]) -> Vec<f64> {
    let rough = (high - low) / 5.0;
    let ten = libm::pow(10.0, libm::log10(rough).floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * ten).find(|s| *s >= rough).unwrap_or(ten);
    let first = (low / step).ceil();
    (0..12).map(|i| (first + f64::from(i)) * step).filter(|v| *v <= high).collect()
}

/// Formats a number with a suitable number of digits.
pub(crate) fn short(value: f64) -> String {
    let size = value.abs();
    match [100.0, 10.0, 1.0, 0.001].iter().position(|least| size >= *least) {
        _ if !value.is_finite() => "–".to_owned(),
        Some(digits) => format!("{value:.digits$}"),
        None if size < 1e-9 => "0".to_owned(),
        None => format!("{value:.1e}"),
    }
}

/// Escapes text for HTML.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
