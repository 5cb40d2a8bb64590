//! `papsynth study`: can people tell?

use papsynth_study::{Interval, Pool, Session, Side, StudyParams, Summary, breakdown_table, table};
use papsynth_web::{Error, Server, serve_study};

use super::open;
use crate::args::Study;
use crate::exit::{self, Complaint, Failure};

pub(crate) fn run(args: &Study) -> Result<(), Failure> {
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
    let stop = exit::watch()?;
    let folder = session.folder().display().to_string();
    session.notes().iter().for_each(|note| exit::note(note));
    exit::print(&announcement(&session, &server))?;
    if args.open {
        open(&server.address());
    }
    let mut all_answered = session.is_finished();
    serve_study(server, session, stop, |session| {
        all_answered = true;
        // Whoever closed the pipe reads the page or the files.
        let _ = exit::print(&format!(
            "\n{}\nIn {folder}: trials.csv, summary.json. Ctrl-C ends.\n",
            results(&session.summary())
        ));
    })?;
    if all_answered {
        return Ok(());
    }
    let message = format!("stopped before the last answer; every answer so far is in {folder}");
    Err(Failure::interrupted(Complaint::new(message).help("run the same command again to go on")))
}

fn announcement(session: &Session, server: &Server) -> String {
    let state = session.state();
    let [real, synthetic] = Side::ALL.map(|side| session.fields(side));
    let done = match state.answered {
        0 => String::new(),
        answered => format!(", {answered} of them answered"),
    };
    format!(
        "{} trials for practice and {} that count{done}; {real} real and {synthetic} synthetic fields\n\
         Open {} in a browser. Ctrl-C ends; the same command goes on.\n",
        state.training,
        state.trials,
        server.address()
    )
}

fn results(summary: &Summary) -> String {
    let breakdown = breakdown_table(&summary.breakdown);
    let by = if breakdown.is_empty() { String::new() } else { format!("\nright answers by parameter\n{breakdown}") };
    format!("{}{}{by}", table([&summary.row, &summary.random]), claim(summary.claim.trials))
}

fn claim(trials: u64) -> String {
    format!(
        "Intervals of 95 % (Wilson); d′ and c with the log-linear correction. A claim of ±5 points takes {trials} trials.\n"
    )
}

/// All subjects in a folder.
fn pooled(folder: &std::path::Path, as_json: bool) -> Result<(), Failure> {
    let pool = Pool::read(folder).map_err(Error::from)?;
    if as_json {
        return exit::print(&format!("{}\n", serde_json::to_string_pretty(&pool).unwrap_or_default()));
    }
    pool.notes.iter().for_each(|note| exit::note(note));
    let rows = pool.subjects.iter().chain([&pool.random, &pool.pooled]);
    let mut text = format!("{}{}", table(rows), claim(pool.claim.trials));
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
    if !means.is_empty() {
        // The interval over subjects tells of other subjects, Wilson's of other patches for the same ones.
        text.push_str(&format!("Means over subjects, with intervals of 95 % by Student's t: {}.\n", means.join(", ")));
    }
    let breakdown = breakdown_table(&pool.breakdown);
    if !breakdown.is_empty() {
        text.push_str(&format!("\nright answers by parameter\n{breakdown}"));
    }
    exit::print(&text)
}
