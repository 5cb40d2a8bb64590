//! `papsynth view`, `papsynth workbench` and `papsynth study`: pages served on this machine.

use std::process::{Command, Stdio};

use papsynth::Inputs;
use papsynth::recipe::Preset;
use papsynth_dataset::Layout;
use papsynth_study::{Group, Interval, Pool, Row, Session, Side, State, StudyParams, Summary, breakdown_table, table};
use papsynth_web::{Error, Server, serve_study};

use crate::args::{Study, View, Workbench};
use crate::exit::{self, ErrorReport, ExitError};
use crate::setup::Setup;
use crate::words::counted;
use crate::{generate, memory};

/// Opens a page in the default browser.
fn open(address: &str) {
    let (program, arguments): (&str, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        // `start` takes the first quoted word as a window title.
        "windows" => ("cmd", &["/C", "start", ""]),
        _ => ("xdg-open", &[]),
    };
    let mut command = Command::new(program);
    command.args(arguments).arg(address).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    if let Err(error) = command.spawn() {
        exit::note(format!("cannot open a browser: {error}"));
    }
}

/// `papsynth view`: shows a data set or a slide in the browser.
pub(crate) fn view(args: &View) -> Result<(), ExitError> {
    let view = papsynth_web::Viewer::open(&args.dir)?;
    let server = Server::bind(args.port.unwrap_or(0))?;
    let stop = exit::stop_flag()?;
    let address = server.address();
    exit::print(&format!(
        "{}: a {}\nOpen {address} in a browser. Press Ctrl-C to quit.\n",
        args.dir.display(),
        view.kind()
    ))?;
    if args.open {
        open(&address);
    }
    Ok(server.run(view, stop, |_| ())?)
}

/// `papsynth workbench`: a recipe and its image, in the browser.
pub(crate) fn workbench(args: &Workbench) -> Result<(), ExitError> {
    let setup = Setup::load(&args.engine, None)?;
    memory::frames_at_once(&setup, &Layout::default(), 1)?;
    let threads = setup.threads_of_a_frame();
    let params = papsynth_web::WorkbenchParams {
        recipe: setup.recipe.recipe,
        preset: args.engine.recipe.preset.unwrap_or(Preset::Lbc),
        model: setup.model,
        inputs: Inputs { weight_map: setup.engine.weight_map().cloned(), ..Inputs::default() },
        seed: args.engine.seed,
        threads,
        max_memory: memory::limit(args.max_memory),
        clock: generate::now,
        images_before: 0,
    };
    let workbench = papsynth_web::Workbench::new(params)?;
    let server = Server::bind(args.port.unwrap_or(0))?;
    let stop = exit::stop_flag()?;
    let address = server.address();
    exit::print(&format!("Open {address} in a browser. Press Ctrl-C to quit.\n"))?;
    if args.open {
        open(&address);
    }
    Ok(server.run(workbench, stop, |_| ())?)
}

/// `papsynth study`: a reader study with real and synthetic patches.
pub(crate) fn study(args: &Study) -> Result<(), ExitError> {
    let (Some(real), Some(synthetic)) = (&args.real, &args.synthetic) else {
        return args.results.as_deref().map_or(Ok(()), |folder| pooled(folder, args.json));
    };
    let params = StudyParams {
        subject: args.subject.clone(),
        task: args.design,
        trials: args.trials,
        training: args.training,
        exposure_ms: args.exposure_ms,
        noise_dn: args.noise,
        patch_px: args.patch_px,
        fields: args.fields,
        seed: args.seed,
        grey: args.grey,
        real_pixel_um: args.pixel_um,
        synthetic_pixel_um: args.synthetic_pixel_um,
    };
    let session = Session::open(&params, real, synthetic, &args.out).map_err(Error::from)?;
    let server = match args.port {
        Some(port) => Server::bind(port)?,
        None => Server::bind_near(session.port())?,
    };
    let stop = exit::stop_flag()?;
    let folder = session.folder().display().to_string();
    session.notes().iter().for_each(exit::note);
    exit::print(&announcement(&session, &server))?;
    if args.open {
        open(&server.address());
    }
    let mut all_answered = session.is_finished();
    serve_study(server, session, stop, |session| {
        all_answered = true;
        // Ignores a closed standard output, because the page and the files hold the results too.
        let results = results(&session.summary());
        let _ = exit::print(&format!("\n{results}\nIn {folder}: trials.csv, summary.json. Press Ctrl-C to quit.\n"));
    })?;
    if all_answered {
        return Ok(());
    }
    let message = format!("stopped before the last answer; all answers so far are in {folder}");
    Err(ExitError::interrupted(ErrorReport::new(message).help("run the same command again to continue")))
}

fn announcement(session: &Session, server: &Server) -> String {
    let state = session.state();
    let [real, synthetic] = Side::ALL.map(|side| session.fields(side));
    let done = match state.answered {
        0 => String::new(),
        answered => format!(", {answered} of them answered"),
    };
    let (State { training, trials, .. }, address) = (state, server.address());
    let practice = counted(training as u64, "practice trial", "practice trials");
    format!(
        "{practice} and {trials} scored trials{done}; {real} real and {synthetic} synthetic fields\n\
         Open {address} in a browser. Press Ctrl-C to quit; run the same command again to continue.\n"
    )
}

fn results(summary: &Summary) -> String {
    tables([&summary.row, &summary.random], summary.precision.trials, "", &summary.breakdown)
}

fn tables<'a>(rows: impl IntoIterator<Item = &'a Row>, trials: u64, means: &str, breakdown: &[Group]) -> String {
    let breakdown = breakdown_table(breakdown);
    let by = if breakdown.is_empty() { String::new() } else { format!("\ncorrect answers by parameter\n{breakdown}") };
    format!(
        "{}95 % intervals (Wilson); d′ and c with the log-linear correction. A margin of ±5 points needs {trials} trials.\n\
         {means}{by}",
        table(rows)
    )
}

fn pooled(folder: &std::path::Path, as_json: bool) -> Result<(), ExitError> {
    let pool = Pool::read(folder).map_err(Error::from)?;
    if as_json {
        return exit::print(&format!("{}\n", serde_json::to_string_pretty(&pool).unwrap_or_default()));
    }
    pool.notes.iter().for_each(exit::note);
    let rows = pool.subjects.iter().chain([&pool.random, &pool.pooled]);
    let means = [
        ("sensitivity", pool.mean_sensitivity),
        ("specificity", pool.mean_specificity),
        ("accuracy", pool.mean_accuracy),
    ];
    let means: Vec<String> = means
        .into_iter()
        .filter_map(|(name, mean)| {
            let (mean, Interval { low, high }) = mean?;
            Some(format!("{name} {mean:.3} ({low:.3} to {high:.3})"))
        })
        .collect();
    // The interval over subjects holds for new subjects, that of Wilson for new patches and the same subjects.
    let means = match means.is_empty() {
        true => String::new(),
        false => format!("Means over subjects with 95 % intervals (Student's t): {}.\n", means.join(", ")),
    };
    exit::print(&tables(rows, pool.precision.trials, &means, &pool.breakdown))
}
