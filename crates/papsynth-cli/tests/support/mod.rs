//! Runs the program in a temporary folder.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, BufWriter, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::SystemTime;

/// Options of a small, fast field.
pub(crate) const TINY: &str = "--set field.width_px=96 --set field.height_px=80 --set layout.kind=uniform \
    --set cells.intermediate.count=2 --set cells.superficial.count=0 --set cells.parabasal.count=0 --set cells.metaplastic.count=0 --set debris.leukocytes.clusters=1 \
    --set debris.bacilli.clusters=1 --set debris.speckles.count=3 --set debris.out_of_focus.count=0";

/// A temporary folder, removed on drop.
pub(crate) struct Bench {
    root: PathBuf,
}

/// Exit code, standard output and standard error of a run.
pub(crate) struct Outcome {
    pub(crate) code: i32,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Bench {
    pub(crate) fn new(name: &str) -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
        fs::create_dir_all(folder).unwrap();
        let path = |n: u32| folder.join(format!("{name}-{}-{n}", std::process::id()));
        // Tests in parallel may use the same name.
        Self { root: (0..).map(path).find(|path| fs::create_dir(path).is_ok()).unwrap() }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    fn command(&self, words: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_papsynth"));
        command.args(words.split_whitespace()).current_dir(&self.root).stdin(Stdio::null());
        command.env_remove("NO_GRAPHICS").env_remove("FORCE_COLOR");
        command.env_remove("SLURM_ARRAY_TASK_ID").env_remove("JOB_COMPLETION_INDEX");
        command
    }

    pub(crate) fn run(&self, words: &str) -> Outcome {
        let output = self.command(words).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Outcome { code: output.status.code().unwrap_or(-1), out: text(output.stdout), err: text(output.stderr) }
    }

    /// A run with an address-space limit in kilobytes, on Linux.
    pub(crate) fn run_within(&self, kilobytes: u64, words: &str) -> Outcome {
        if !cfg!(target_os = "linux") {
            return self.run(words);
        }
        let limited = format!("ulimit -v {kilobytes} && exec \"$0\" \"$@\"");
        let mut command = Command::new("sh");
        command.args(["-c", &limited, env!("CARGO_BIN_EXE_papsynth")]).args(words.split_whitespace());
        let output = command.current_dir(&self.root).stdin(Stdio::null()).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Outcome { code: output.status.code().unwrap_or(-1), out: text(output.stdout), err: text(output.stderr) }
    }

    /// The output of a shell script that may mount disks. Its arguments are the program and `words`. `None` where the
    /// system does not allow it.
    pub(crate) fn script_as_root(&self, script: &str, words: &str) -> Option<String> {
        let mut command = Command::new("unshare");
        command.args(["--map-root-user", "--mount", "sh", "-c", script, "sh", env!("CARGO_BIN_EXE_papsynth")]);
        let output =
            command.args(words.split_whitespace()).current_dir(&self.root).stdin(Stdio::null()).output().ok()?;
        output.status.success().then(|| String::from_utf8(output.stdout).unwrap())
    }

    /// A run with environment variables.
    pub(crate) fn run_with(&self, words: &str, variables: &[(&str, &str)]) -> Outcome {
        let output = self.command(words).envs(variables.iter().copied()).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Outcome { code: output.status.code().unwrap_or(-1), out: text(output.stdout), err: text(output.stderr) }
    }

    /// A run in the background.
    pub(crate) fn spawn(&self, words: &str) -> std::process::Child {
        self.command(words).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
    }

    /// A run in the background with a pipe for standard output.
    pub(crate) fn spawn_piped(&self, words: &str) -> std::process::Child {
        self.command(words).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap()
    }

    /// A run in the background that serves a page and prints its address.
    #[cfg(unix)]
    pub(crate) fn serve(&self, words: &str) -> Server {
        use std::io::{BufRead, BufReader};
        let mut child = self.spawn_piped(words);
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let port = lines.find_map(|line| {
            let line = line.unwrap();
            let address = line.split_whitespace().find_map(|word| word.strip_prefix("http://127.0.0.1:"))?;
            Some(address.trim_end_matches('/').parse().unwrap())
        });
        Server { child, port: port.unwrap() }
    }

    /// A run that must succeed.
    pub(crate) fn good(&self, words: &str) -> Outcome {
        let outcome = self.run(words);
        assert_eq!(outcome.code, 0, "papsynth {words}\n{}{}", outcome.out, outcome.err);
        outcome
    }

    /// The exit code of a run with a closed standard output.
    pub(crate) fn run_into_closed_pipe(&self, words: &str) -> Option<i32> {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        self.command(words).stdout(writer).stderr(Stdio::null()).status().unwrap().code()
    }

    /// Interrupts a run, like Ctrl-C, after two lines of output.
    #[cfg(unix)]
    pub(crate) fn interrupt_after_first_line(&self, words: &str) -> Outcome {
        let mut child = self.command(words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let mut text = String::new();
        // The start, and the first frame.
        out.read_line(&mut text).unwrap();
        out.read_line(&mut text).unwrap();
        let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(killed.success());
        out.read_to_string(&mut text).unwrap();
        let mut err = String::new();
        child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
        Outcome { code: child.wait().unwrap().code().unwrap_or(-1), out: text, err }
    }

    /// The content of every file below a folder, by its name.
    pub(crate) fn files(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        self.walk(folder).into_iter().map(|(name, path)| (name, fs::read(path).unwrap())).collect()
    }

    /// When every file below a folder was written.
    pub(crate) fn times(&self, folder: &str) -> BTreeMap<String, SystemTime> {
        self.walk(folder)
            .into_iter()
            .map(|(name, path)| (name, fs::metadata(path).unwrap().modified().unwrap()))
            .collect()
    }

    fn walk(&self, folder: &str) -> Vec<(String, PathBuf)> {
        let root = self.path(folder);
        let (mut open, mut found) = (vec![root.clone()], Vec::new());
        while let Some(folder) = open.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    open.push(path);
                } else {
                    let name = path.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
                    found.push((name, path));
                }
            }
        }
        found
    }

    /// Writes a grey PNG.
    pub(crate) fn grey_png(&self, name: &str, width: u32, height: u32, grey: impl Fn(u32, u32) -> u8) {
        let file = BufWriter::new(fs::File::create(self.path(name)).unwrap());
        let mut encoder = png::Encoder::new(file, width, height);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Eight);
        let pixels: Vec<u8> =
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| grey(x, y)).collect();
        encoder.write_header().unwrap().write_image_data(&pixels).unwrap();
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.root);
    }
}

/// A table of outlines: circles with different lobes.
pub(crate) fn outlines(count: usize, points: usize, radius_px: f64) -> String {
    let mut text = String::from("outline,k,x_px,y_px\n");
    for outline in 0..count {
        for k in 0..points {
            let angle = std::f64::consts::TAU * k as f64 / points as f64;
            let lobes = 1.0 + 0.10 * sine(3.0 * angle + outline as f64) + 0.05 * sine((2 + outline % 4) as f64 * angle);
            let (x, y) = (sine(angle + std::f64::consts::FRAC_PI_2), sine(angle));
            text.push_str(&format!("{outline},{k},{:.3},{:.3}\n", radius_px * lobes * x, radius_px * lobes * y));
        }
    }
    text
}

/// A sine by its series, exact to a thousandth of a pixel.
fn sine(angle: f64) -> f64 {
    let turns = (angle / std::f64::consts::TAU).round();
    let x = angle - turns * std::f64::consts::TAU;
    let (mut term, mut sum) = (x, x);
    for n in 1..14 {
        term *= -x * x / (f64::from(2 * n) * f64::from(2 * n + 1));
        sum += term;
    }
    sum
}

/// A run that serves a page.
#[cfg(unix)]
pub(crate) struct Server {
    child: std::process::Child,
    pub(crate) port: u16,
}

#[cfg(unix)]
impl Server {
    /// The JSON reply to a GET request.
    pub(crate) fn get(&self, target: &str) -> serde_json::Value {
        serde_json::from_slice(&self.send(&format!("GET {target}"), "", &[])).unwrap()
    }

    /// The body of the reply to a POST request.
    pub(crate) fn post(&self, target: &str, content_type: &str, body: &[u8]) -> Vec<u8> {
        self.send(&format!("POST {target}"), &format!("Content-Type: {content_type}\r\n"), body)
    }

    fn send(&self, line: &str, headers: &str, body: &[u8]) -> Vec<u8> {
        use std::io::{Read, Write};
        let mut stream = std::net::TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        let (port, length) = (self.port, body.len());
        let head = format!(
            "{line} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n{headers}Content-Length: {length}\r\n\r\n"
        );
        stream.write_all(head.as_bytes()).unwrap();
        stream.write_all(body).unwrap();
        let mut reply = Vec::new();
        stream.read_to_end(&mut reply).unwrap();
        let end = reply.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        reply.split_off(end + 4)
    }

    /// Peak memory of the process, bytes.
    #[cfg(target_os = "linux")]
    pub(crate) fn peak_bytes(&self) -> u64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
        1024 * line.trim().strip_suffix("kB").unwrap().trim().parse::<u64>().unwrap()
    }

    /// Ends the run like Ctrl-C and returns its exit code.
    pub(crate) fn interrupt(mut self) -> Option<i32> {
        let id = self.child.id().to_string();
        assert!(std::process::Command::new("kill").args(["-INT", &id]).status().unwrap().success());
        self.child.wait().unwrap().code()
    }
}
