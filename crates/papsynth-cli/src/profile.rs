//! `generate --profile`: where the time went.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use papsynth::profile::{Profile, Stage};
use papsynth_dataset::{FrameSummary, Progress};
use serde_json::json;

/// What a run made, and how long it took.
#[derive(Debug)]
pub(crate) struct Account {
    pub(crate) profile: Arc<Profile>,
    begun: Duration,
    frames: AtomicU64,
    pixels: AtomicU64,
    objects: AtomicU64,
}

/// Time since this was first asked for.
#[expect(clippy::disallowed_methods, reason = "how long something took is what is asked for; it reaches no image")]
fn now() -> Duration {
    static BEGUN: OnceLock<Instant> = OnceLock::new();
    BEGUN.get_or_init(Instant::now).elapsed()
}

impl Account {
    pub(crate) fn open() -> Self {
        let profile = Arc::new(Profile::new(now));
        let zero = AtomicU64::default;
        Self { profile, begun: now(), frames: zero(), pixels: zero(), objects: zero() }
    }

    /// A frame is done, or was there.
    pub(crate) fn step(&self, step: Progress) {
        let Progress::Made(FrameSummary { width, height, channels, planes_um, objects, .. }) = step else { return };
        let add = |sum: &AtomicU64, value: u64| sum.fetch_add(value, Ordering::Relaxed);
        add(&self.frames, 1);
        add(&self.pixels, (width * height * channels * planes_um.len()) as u64);
        add(&self.objects, objects.values().sum());
    }

    fn rates(&self) -> [f64; 3] {
        let seconds = now().saturating_sub(self.begun).as_secs_f64().max(1e-9);
        [&self.frames, &self.pixels, &self.objects].map(|sum| sum.load(Ordering::Relaxed) as f64 / seconds)
    }

    fn milliseconds_a_frame(&self, stage: Stage) -> f64 {
        self.profile.spent(stage).as_secs_f64() * 1e3 / self.frames.load(Ordering::Relaxed).max(1) as f64
    }

    pub(crate) fn table(&self, threads: usize) -> String {
        let rows = Stage::ALL.map(|stage| (stage.name(), self.milliseconds_a_frame(stage)));
        let all: f64 = rows.iter().map(|row| row.1).sum();
        let mut text = format!("{:<20}{:>12}{:>8}\n", "stage", "ms a frame", "share");
        for (name, spent) in rows.into_iter().chain([("all stages", all)]) {
            text.push_str(&format!("{name:<20}{spent:>12.2}{:>6.1} %\n", 100.0 * spent / all.max(1e-9)));
        }
        let [frames, pixels, objects] = self.rates();
        let s = if threads == 1 { "" } else { "s" };
        text.push_str(&format!(
            "{frames:.1} frames a second on {threads} thread{s}: {:.1} million pixels, {objects:.0} objects and parts a second\n",
            pixels / 1e6
        ));
        text
    }

    pub(crate) fn event(&self, threads: usize) -> serde_json::Value {
        let stages =
            Stage::ALL.map(|stage| json!({ "stage": stage.name(), "ms_a_frame": self.milliseconds_a_frame(stage) }));
        let [frames, pixels, objects] = self.rates();
        json!({
            "event": "profile", "threads": threads, "stages": stages,
            "frames_per_s": frames, "pixels_per_s": pixels, "objects_per_s": objects,
        })
    }
}
