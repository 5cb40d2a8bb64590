//! The page, served on loopback alone.

mod desk;

use std::sync::atomic::AtomicBool;

use papsynth_loopback::Server;

use crate::error::Error;
use crate::session::Session;
use desk::Desk;

/// Serves a study until `stop` is set. `finished` is called once when everything has been answered, at once if it has been
/// before.
///
/// # Errors
/// If the system refuses what serving takes, or the port cannot be kept with the study.
pub fn serve(
    server: Server,
    mut session: Session,
    stop: &AtomicBool,
    mut finished: impl FnMut(&Session),
) -> Result<(), Error> {
    session.set_port(server.port())?;
    let mut told = false;
    server.run(Desk { session }, stop, |desk| {
        if !told && desk.session.is_finished() {
            told = true;
            finished(&desk.session);
        }
    })?;
    Ok(())
}
