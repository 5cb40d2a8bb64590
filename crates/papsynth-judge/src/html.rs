//! The report as a page that needs nothing else.

use std::fmt::Write;

use crate::beside::{Beside, Curve, Spread};
use crate::crops::Crop;
use crate::judge::{Report, Test, Verdict};
use crate::moments::Moments;
use crate::number::nearest;
use crate::svg::{COLOURS, Plot, escape, short};
use crate::two_sample::TwoSample;

/// Giveaways that are listed.
const LISTED: usize = 30;

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;margin:2em auto;max-width:1240px;padding:0 1em;color:#222}\
h1{font-size:1.5em}h2{margin-top:2em;border-bottom:1px solid #ccc}table{border-collapse:collapse;font-size:13px}\
td,th{padding:2px 9px;text-align:right;border-bottom:1px solid #eee}td:first-child,th:first-child{text-align:left}\
svg text{font:11px system-ui,sans-serif;fill:#333}svg .title{font-weight:600;font-size:12px}\
.told{color:#b03000;font-weight:600}.not{color:#00704a;font-weight:600}.out{color:#b03000}\
.real{color:#0072b2}.synthetic{color:#d55e00}.plots{display:flex;flex-wrap:wrap;gap:14px}\
.crops{display:flex;flex-wrap:wrap;gap:5px}.crops figure{margin:0;font-size:10px;text-align:center;color:#666}\
.nuclei img{width:80px;image-rendering:pixelated}.patches img{width:150px}.note{color:#555}";

/// Adds text to a page. Writing to a string cannot fail.
macro_rules! put {
    ($page:expr, $($text:tt)*) => {{
        let _ = write!($page, $($text)*);
    }};
}

impl Report {
    /// The report as an HTML page: drawings and crops are in it, nothing is loaded from elsewhere. It shows pieces of the pictures
    /// that were judged.
    #[must_use]
    pub fn to_html(&self) -> String {
        let mut page = String::new();
        let [real, synthetic] = &self.fields;
        put!(
            page,
            "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>papsynth judge</title><style>{STYLE}</style></head><body>\
             <h1>{} real fields against {} synthetic ones: {}</h1>",
            real.len(),
            synthetic.len(),
            verdict(self.verdict)
        );
        put!(
            page,
            "<p>Pixels of {} µm; nuclei {}; seed {}. <span class=\"real\">Real</span> and <span class=\"synthetic\">synthetic</span> \
             have these colours throughout.</p>",
            self.gauge.pixel_um,
            match self.gauge.nuclei_from {
                crate::NucleiFrom::Masks => "from masks",
                crate::NucleiFrom::Points => "around given points",
                crate::NucleiFrom::Search => "found",
            },
            self.judge.seed
        );
        for note in &self.notes {
            put!(page, "<p class=\"note\">{}</p>", escape(note));
        }
        summary(&mut page, self);
        for test in &self.two_sample {
            two_sample(&mut page, test, &self.crops);
        }
        for test in &self.moments {
            moments(&mut page, test);
        }
        beside(&mut page, &self.beside);
        page.push_str("</body></html>\n");
        page
    }
}

fn verdict(verdict: Verdict) -> String {
    let class = if verdict == Verdict::ToldApart { "told" } else { "not" };
    format!("<span class=\"{class}\">{verdict}</span>")
}

fn summary(page: &mut String, report: &Report) {
    page.push_str("<h2>Tests</h2><table><tr><th>test</th><th>rows</th><th>AUC</th><th>95 % interval</th><th>between real halves</th><th>verdict</th></tr>");
    for test in &report.two_sample {
        let r = &test.result;
        let null = Spread::of(r.null.iter().copied());
        put!(
            page,
            "<tr><td>classifier on {}</td><td>{} / {}</td><td>{:.3}</td><td>{:.3} – {:.3}</td><td>{} ({} – {}), {} rows a half</td><td>{}</td></tr>",
            escape(&test.name),
            r.rows[0],
            r.rows[1],
            r.auc,
            r.interval[0],
            r.interval[1],
            known(null.p50),
            known(null.p10),
            known(null.p90),
            r.null_rows,
            verdict(test.verdict)
        );
    }
    for test in &report.moments {
        let outside = test.result.descriptors.iter().filter(|d| !d.within).count();
        let slopes: Vec<String> = test.result.descriptors.iter().map(|d| format!("{:.2}", d.slope[1])).collect();
        put!(
            page,
            "<tr><td>Q-Q slopes, {}</td><td>{}</td><td></td><td>{}</td><td>{outside} of {} outside</td><td>{}</td></tr>",
            escape(&test.name),
            test.result.n,
            slopes.join(" "),
            test.result.descriptors.len(),
            verdict(test.verdict)
        );
    }
    page.push_str(
        "</table><p class=\"note\">A classifier tells the sides apart if its area under the ROC curve is larger than 95 of 100 between random \
         halves of the real fields, and the 95 % interval of it (fields drawn with replacement) leaves out ½. Fields are never split between what it learns from and \
         what it is tried on. Moments tell them apart if a slope or a shift of medians lies outside what 199 of 200 pairs of disjoint \
         real halves show at the same number of nuclei: by chance, one of the twelve does in one comparison of seventeen or fewer.</p>",
    );
}

fn known(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), short)
}

fn two_sample(page: &mut String, test: &Test<TwoSample>, crops: &[Crop]) {
    let r = &test.result;
    put!(
        page,
        "<h2>What gives {} away</h2><p>AUC {:.3}, {}. With features of one kind alone: ",
        escape(&test.name),
        r.auc,
        verdict(test.verdict)
    );
    let kinds: Vec<String> =
        r.families.iter().map(|f| format!("{} {:.2}", format!("{:?}", f.family).to_lowercase(), f.auc)).collect();
    put!(page, "{}.</p><div class=\"plots\">{}{}</div>", kinds.join(", "), strip(r), scores(r));
    page.push_str(
        "<table><tr><th>feature</th><th>importance</th><th>AUC alone</th><th class=\"real\">real p10</th><th class=\"real\">p50</th><th class=\"real\">p90</th>\
         <th class=\"synthetic\">synthetic p10</th><th class=\"synthetic\">p50</th><th class=\"synthetic\">p90</th>\
         <th class=\"real\">sd between fields</th><th class=\"synthetic\">sd between fields</th></tr>",
    );
    for g in r.giveaways.iter().take(LISTED) {
        put!(page, "<tr><td>{}</td><td>{:.3}</td><td>{:.2}</td>", escape(&g.feature), g.importance, g.alone);
        for v in g.real.iter().chain(&g.synthetic).chain(&g.between_fields) {
            put!(page, "<td>{}</td>", short(*v));
        }
        page.push_str("</tr>");
    }
    page.push_str(
        "</table><p class=\"note\">Importance: how much nearer the mean scores of both sides come, as a part of their distance, when the feature is \
         shuffled among rows that the classifier has not seen. Of features that tell the same, each alone matters little. AUC alone is above ½ if the feature is larger in synthetic fields. Between fields: of their medians.</p>",
    );
    for (synthetic, looks_real, title) in [
        (true, true, "Synthetic, most convincing"),
        (true, false, "Synthetic, least convincing"),
        (false, true, "Real, most plainly real"),
        (false, false, "Real, taken for synthetic"),
    ] {
        let chosen: Vec<&Crop> = crops
            .iter()
            .filter(|c| c.of == test.name && c.synthetic == synthetic && c.looks_real == looks_real)
            .collect();
        if chosen.is_empty() {
            continue;
        }
        put!(page, "<h3>{title}</h3><div class=\"crops {}\">", test.name);
        for crop in chosen {
            put!(
                page,
                "<figure><img alt=\"\" src=\"data:image/png;base64,{}\"><br>{:.2} {}</figure>",
                base64(&png(&crop.grey, crop.width)),
                crop.score,
                escape(&crop.field)
            );
        }
        page.push_str("</div>");
    }
}

/// The AUC and its interval among those between halves.
fn strip(r: &TwoSample) -> String {
    let all = r.null.iter().copied().chain(r.interval).chain([0.3, 1.0]);
    let mut plot =
        Plot::new("AUC with its 95 % interval", "AUC", "1 real halves, 2 the sides", all, [0.0, 3.0].into_iter());
    plot.dashes([0.5, 0.0], [0.5, 3.0]);
    plot.dots(r.null.iter().map(|v| [*v, 1.0]), COLOURS[0]);
    plot.line(r.interval.iter().map(|v| [*v, 2.0]), COLOURS[1]);
    plot.dots([[r.auc, 2.0]].into_iter(), COLOURS[1]);
    plot.finish()
}

/// Histograms of the scores of both sides.
fn scores(r: &TwoSample) -> String {
    const BINS: usize = 25;
    let bins = r.scores.each_ref().map(|scores| {
        let mut bins = vec![0.0; BINS];
        scores
            .iter()
            .for_each(|s| bins[nearest(s * BINS as f64 - 0.5).min(BINS - 1)] += 1.0 / scores.len().max(1) as f64);
        bins
    });
    let mut plot = Plot::new(
        "Scores of rows not learnt from",
        "how synthetic it looks",
        "part",
        [0.0, 1.0].into_iter(),
        bins.iter().flatten().copied().chain([0.0]),
    );
    for (bins, colour) in bins.iter().zip(COLOURS) {
        plot.line(bins.iter().enumerate().map(|(i, v)| [(i as f64 + 0.5) / BINS as f64, *v]), colour);
    }
    plot.finish()
}

fn moments(page: &mut String, test: &Test<Moments>) {
    put!(page, "<h2>{}: {}</h2>", escape(&test.name), verdict(test.verdict));
    page.push_str(
        "<table><tr><th>descriptor</th><th>Q-Q slope (5 – 95 %)</th><th>between real halves (0.25 – 99.75 %)</th><th>shift, sd (5 – 95 %)</th>\
         <th>between real halves</th></tr>",
    );
    for d in &test.result.descriptors {
        let three = |v: [f64; 3]| format!("{:.2} ({:.2} – {:.2})", v[1], v[0], v[2]);
        put!(
            page,
            "<tr{}><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            if d.within { "" } else { " class=\"out\"" },
            escape(&d.name),
            three(d.slope),
            three(d.null_slope),
            three(d.shift),
            three(d.null_shift)
        );
    }
    page.push_str("</table><div class=\"plots\">");
    for d in &test.result.descriptors {
        let all: Vec<f64> = d.quantiles.iter().flatten().copied().collect();
        let (low, high) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let mut plot = Plot::new(&d.name, "synthetic", "real", all.iter().copied(), all.iter().copied());
        plot.dashes([low, low], [high, high]);
        plot.dots(d.quantiles.iter().map(|q| [q[1], q[0]]), COLOURS[1]);
        page.push_str(&plot.finish());
    }
    page.push_str("</div><p class=\"note\">Quantiles of all nuclei of either side; the slopes are those of random draws of as many as the heading says. Steeper than the dashes: real nuclei spread more.</p>");
}

fn beside(page: &mut String, beside: &Beside) {
    page.push_str("<h2>Field statistics</h2><div class=\"plots\">");
    for curve in &beside.curves {
        page.push_str(&drawn(curve));
    }
    page.push_str(
        "</div><table><tr><th>statistic</th><th class=\"real\">real p10</th><th class=\"real\">p50</th><th class=\"real\">p90</th>\
         <th class=\"synthetic\">synthetic p10</th><th class=\"synthetic\">p50</th><th class=\"synthetic\">p90</th></tr>",
    );
    for s in &beside.scalars {
        put!(page, "<tr{}><td>{}</td>", if s.within { "" } else { " class=\"out\"" }, escape(&s.name));
        for v in [s.real.p10, s.real.p50, s.real.p90, s.synthetic.p10, s.synthetic.p50, s.synthetic.p90] {
            put!(page, "<td>{}</td>", known(v));
        }
        page.push_str("</tr>");
    }
    page.push_str("</table><p class=\"note\">Over fields. Red: the synthetic median lies outside the real 10th to 90th percentile.</p>");
}

fn drawn(curve: &Curve) -> String {
    let points = |spreads: &[Spread], of: fn(&Spread) -> Option<f64>| -> Vec<[f64; 2]> {
        curve.at.iter().zip(spreads).map(|(x, s)| [*x, of(s).unwrap_or(f64::NAN)]).collect()
    };
    let all = curve.real.iter().chain(&curve.synthetic).flat_map(|s| [s.p10, s.p90]).flatten();
    let mut plot = Plot::new(&curve.name, &curve.along, "", curve.at.iter().copied(), all);
    for (spreads, colour) in [&curve.real, &curve.synthetic].into_iter().zip(COLOURS) {
        plot.band(&points(spreads, |s| s.p10), &points(spreads, |s| s.p90), colour);
        plot.line(points(spreads, |s| s.p50).into_iter(), colour);
    }
    plot.finish()
}

/// A picture in grey as a PNG file.
fn png(grey: &[u8], width: usize) -> Vec<u8> {
    let mut out = Vec::new();
    let size = [width, grey.len() / width.max(1)].map(crate::number::id);
    let mut encoder = png::Encoder::new(&mut out, size[0], size[1]);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    // Crops are at least a pixel, and memory takes what is written to it.
    let _ = encoder.write_header().and_then(|mut writer| writer.write_image_data(grey));
    out
}

/// Bytes in the alphabet of RFC 4648.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let bits = three.iter().fold(0_usize, |b, v| b << 8 | usize::from(*v)) << (8 * (3 - three.len()));
        for i in 0..4 {
            out.push(if i <= three.len() { char::from(LETTERS[bits >> (18 - 6 * i) & 63]) } else { '=' });
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_rfc() {
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }
}
