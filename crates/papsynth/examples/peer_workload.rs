//! Times the workload of the Python reference program: `peer_workload frame|stack|throughput COUNT [THREADS]`.
//!
//! Prints one line of JSON with the medians of process CPU time and wall time per frame or stack, and peak resident
//! memory. Includes the ground truth of every image; writes no files.

#![expect(clippy::print_stdout, reason = "the program prints its measurements")]

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{Number, Recipe};
use papsynth::truth::Group;
use papsynth::{Engine, Error, Inputs, Threads};

/// The recipe that matches the defaults of the reference program.
const RECIPE: &str = include_str!("../../../benches/peer.toml");

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let what = arguments.next().unwrap_or_else(|| "frame".to_owned());
    let count: u64 = arguments.next().map_or(Ok(7), |text| text.parse())?;
    let threads: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let mut recipe: Recipe = toml::from_str(RECIPE)?;
    if what == "stack" {
        recipe.focus.planes = Number::Fixed(21.0);
        recipe.focus.step_um = Number::Fixed(0.4);
    }
    let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default())?;
    let mut buffers = TruthBuffers::default();
    if what == "throughput" {
        return throughput(&engine, count, threads);
    }
    render(&engine, 0, &mut buffers)?;
    let (mut cpu, mut wall) = (Vec::new(), Vec::new());
    for index in 1..=count {
        let (c, w) = (cpu_seconds(), now());
        render(&engine, index, &mut buffers)?;
        cpu.push(cpu_seconds() - c);
        wall.push(w.elapsed().as_secs_f64());
    }
    println!(
        "{{\"what\":\"{what}\",\"cpu_med\":{:.6},\"cpu_min\":{:.6},\"wall_med\":{:.6},\"peak_mb\":{:.1}}}",
        median(&mut cpu),
        cpu.first().copied().unwrap_or(0.0),
        median(&mut wall),
        peak_mb()
    );
    Ok(())
}

/// Prints frames per second of wall time with several threads, one frame per thread.
fn throughput(engine: &Engine, count: u64, threads: u64) -> Result<(), Box<dyn std::error::Error>> {
    let (start, next) = (now(), AtomicU64::new(0));
    std::thread::scope(|scope| {
        let work = || {
            let mut buffers = TruthBuffers::default();
            while let Some(index) = Some(next.fetch_add(1, Ordering::Relaxed)).filter(|index| *index < count) {
                render(engine, index, &mut buffers)?;
            }
            Ok::<(), Error>(())
        };
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        workers.into_iter().try_for_each(|worker| worker.join().expect("no thread panics"))
    })?;
    let seconds = start.elapsed().as_secs_f64();
    println!("{{\"what\":\"throughput\",\"threads\":{threads},\"frames_per_s\":{:.4}}}", count as f64 / seconds);
    Ok(())
}

/// Buffers for label maps and overlap counts.
#[derive(Default)]
struct TruthBuffers {
    ids: Vec<u32>,
    layers: Vec<u16>,
}

fn render(engine: &Engine, index: u64, buffers: &mut TruthBuffers) -> Result<(), Error> {
    let mut sum = 0_u64;
    let truth = engine
        .stream::<Error>(Key { seed: 3, index }, Threads::One, |plane| {
            sum += plane.grey.iter().map(|g| u64::from(*g)).sum::<u64>();
            Ok(())
        })?
        .truth;
    for group in Group::ALL {
        truth.labels_into(group, &mut buffers.ids);
        std::hint::black_box(&buffers.ids);
    }
    truth.layers_into(&mut buffers.layers);
    std::hint::black_box((sum, &buffers.layers, truth.objects.len()));
    Ok(())
}

#[expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]
fn now() -> Instant {
    Instant::now()
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Returns the CPU time of this process so far, user and system, in seconds.
fn cpu_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 / 1e9
}

/// Returns the peak resident memory, MB.
fn peak_mb() -> f64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("VmHWM"));
    line.and_then(|l| l.split_whitespace().nth(1)).and_then(|t| t.parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}
