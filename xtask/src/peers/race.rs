//! Both sides in turn.

use std::collections::BTreeMap;

use anyhow::{Context, Result};

use super::rows::{Growth, Row, Source};
use super::sides::{Answer, Kernels, Measured, Ours, Peer};

/// Frames and stacks that a process makes for one figure: of the peer, of ours.
const FRAMES: [usize; 2] = [3, 15];
const STACKS: [usize; 2] = [1, 3];

/// Frames a process makes while another does the same: of the peer, of ours.
const AT_ONCE: [usize; 2] = [6, 60];

/// How long a kernel runs in one turn, seconds.
const KERNEL_S: f64 = 0.25;

/// What was found of a row: time in milliseconds, memory in MB, or an exponent.
#[derive(Clone, Copy)]
pub(crate) struct Figures {
    pub(crate) peer: Option<f64>,
    pub(crate) ours: f64,
}

impl Figures {
    /// Ours over the peer's.
    pub(crate) fn ratio(self) -> Option<f64> {
        self.peer.map(|peer| self.ours / peer)
    }
}

/// A row's figures, or why there are none.
pub(crate) enum Found {
    Figures(Figures),
    Missing(String),
}

/// Everyone who takes part.
pub(crate) struct Race {
    peer: Option<Peer>,
    ours: Ours,
    /// Programs of kernels, the peer's and ours.
    kernels: Option<(Kernels, Kernels)>,
    /// Whole programs that were measured already, the peer's and ours.
    programs: BTreeMap<&'static str, (Measured, Measured)>,
    /// How often both sides are measured.
    turns: usize,
    /// What there is to say below the table.
    pub(crate) notes: Vec<String>,
}

impl Race {
    pub(crate) fn new(peer: Option<Peer>, ours: Ours, turns: usize) -> Self {
        Self { peer, ours, kernels: None, programs: BTreeMap::new(), turns, notes: Vec::new() }
    }

    pub(crate) fn row(&mut self, row: &Row) -> Result<Found> {
        if row.source.needs_peer() && self.peer.is_none() {
            return Ok(Found::Missing("no peer".to_owned()));
        }
        let figures = match row.source {
            Source::Kernel(theirs, ours) => return self.kernel(theirs, ours),
            Source::Program(work) => {
                let (peer, ours) = self.program(work)?;
                Figures { peer: Some(1e3 * peer.cpu_s), ours: 1e3 * ours.cpu_s }
            }
            Source::Memory(work) => {
                let (peer, ours) = self.program(work)?;
                Figures { peer: Some(peer.peak_mb), ours: ours.peak_mb }
            }
            Source::TwoCores => self.two_cores()?,
            Source::TwoThreads => self.two_threads()?,
            Source::Growth(growth) => Figures { peer: None, ours: self.growth(growth)? },
        };
        Ok(Found::Figures(figures))
    }

    fn peer(&self) -> Result<&Peer> {
        self.peer.as_ref().context("there is no peer")
    }

    fn kernel(&mut self, theirs: &str, ours: &str) -> Result<Found> {
        if self.kernels.is_none() {
            self.kernels = Some((self.peer()?.kernels()?, self.ours.kernels()?));
        }
        let (peer, own) = self.kernels.as_mut().context("they were just started")?;
        let (mut peer_s, mut own_s) = (Vec::new(), Vec::new());
        for _ in 0..self.turns {
            for (program, work, seconds) in [(&mut *peer, theirs, &mut peer_s), (&mut *own, ours, &mut own_s)] {
                match program.measure(work, KERNEL_S)? {
                    Answer::Figures(figures) => seconds.extend(figures),
                    Answer::Missing(reason) => return Ok(Found::Missing(reason)),
                }
            }
        }
        Ok(Found::Figures(Figures { peer: Some(1e3 * median(&mut peer_s)), ours: 1e3 * median(&mut own_s) }))
    }

    fn program(&mut self, work: &'static str) -> Result<(Measured, Measured)> {
        if let Some(known) = self.programs.get(work) {
            return Ok(*known);
        }
        let [theirs, own] = if work == "stack" { STACKS } else { FRAMES };
        let (mut peer, mut ours) = (Vec::new(), Vec::new());
        for _ in 0..self.turns {
            peer.push(self.peer()?.measure(work, theirs)?);
            ours.push(self.ours.measure(work, own)?);
        }
        let both = (middle(&peer), middle(&ours));
        self.programs.insert(work, both);
        Ok(both)
    }

    /// Time of a frame with both cores at work: two threads of ours.
    fn own_two_threads(&self) -> Result<f64> {
        Ok(1e3 / self.ours.frames_per_s(1, 2 * AT_ONCE[1], 2)?)
    }

    fn two_cores(&self) -> Result<Figures> {
        let (mut peer, mut ours) = (Vec::new(), Vec::new());
        for _ in 0..self.turns {
            let sides = self.peer()?.side_by_side(2, "frame", AT_ONCE[0])?;
            peer.push(1e3 / sides.iter().map(|side| 1.0 / side.wall_s).sum::<f64>());
            ours.push(self.own_two_threads()?);
        }
        Ok(Figures { peer: Some(median(&mut peer)), ours: median(&mut ours) })
    }

    fn two_threads(&self) -> Result<Figures> {
        let (mut processes, mut threads) = (Vec::new(), Vec::new());
        for _ in 0..self.turns {
            processes.push(1e3 / self.ours.frames_per_s(2, AT_ONCE[1], 1)?);
            threads.push(self.own_two_threads()?);
        }
        Ok(Figures { peer: Some(median(&mut processes)), ours: median(&mut threads) })
    }

    /// The exponent of time against size, by least squares on logarithms.
    #[expect(clippy::disallowed_methods, reason = "a figure for people, which reaches no pixel")]
    fn growth(&mut self, growth: &Growth) -> Result<f64> {
        // A process of its own, so that the memory of large fields is given back.
        let mut own = self.ours.kernels()?;
        let (mut points, mut words) = (Vec::new(), Vec::new());
        for &size in growth.sizes {
            let Answer::Figures(mut figures) = own.measure(&format!("{}-{size}", growth.kind), KERNEL_S)? else {
                continue;
            };
            let seconds = median(&mut figures);
            words.push(format!("{size}: {:.2} ms", 1e3 * seconds));
            if size >= growth.from {
                points.push([growth.power * f64::from(size).ln(), seconds.ln()]);
            }
        }
        self.notes.push(format!(
            "Growth with {} {}. Fitted from {} on, with as much of everything per area.",
            growth.what,
            words.join(", "),
            growth.from
        ));
        Ok(slope(&points))
    }
}

/// The median of times, the largest of memory.
fn middle(all: &[Measured]) -> Measured {
    let median_of = |value: fn(&Measured) -> f64| median(&mut all.iter().map(value).collect::<Vec<_>>());
    Measured {
        cpu_s: median_of(|m| m.cpu_s),
        wall_s: median_of(|m| m.wall_s),
        peak_mb: all.iter().map(|m| m.peak_mb).fold(0.0, f64::max),
    }
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The slope of the straight line with the least squares.
fn slope(points: &[[f64; 2]]) -> f64 {
    let mean = |k: usize| points.iter().map(|point| point[k]).sum::<f64>() / points.len() as f64;
    let (x, y) = (mean(0), mean(1));
    let sum = |f: fn(f64, f64) -> f64| points.iter().map(|point| f(point[0] - x, point[1] - y)).sum::<f64>();
    sum(|x, y| x * y) / sum(|x, _| x * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_a_line_is_found() {
        let points = [[0.0, 1.0], [1.0, 3.0], [2.0, 5.0], [5.0, 11.0]];
        assert!((slope(&points) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_median_lies_in_the_middle() {
        assert_eq!(median(&mut [9.0, 1.0, 5.0]), 5.0);
        assert!(median(&mut []).is_nan());
    }
}
