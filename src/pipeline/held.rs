//! Whether there is memory for the photons that a run stores, before any of them is traced.

use super::Job;
use crate::error::{Error, Result};
use crate::integrate::Integrator;
use crate::photon::Photon;
use crate::plan::Density;
use crate::progress::Progress;
use crate::room;

/// What a stored photon takes, bytes: itself, and at most so much of the trees that photons are looked for in; an
/// eighth of them is there twice. Peaks of 1M and of 6M to 24M photons differ by 41.4 bytes a photon (duality of one region), 28 (of 21,
/// whose trees stand one after another); those of 2M and of 6M by 45.9 (picture).
const EACH: u64 = size_of::<Photon>() as u64 + 23;

/// Refuses more photons than there is memory for on this rank; with a `picture`, also those that it stores.
///
/// # Errors
/// [`Error::Machine`], and [`Error::Interrupted`] where ranks meet.
pub(super) fn check(job: &Job, picture: bool, progress: &dyn Progress) -> Result<()> {
    let duality = job.density == Density::Duality;
    let stored = duality || picture && job.picture.integrator == Some(Integrator::Photon);
    if !stored {
        return Ok(());
    }
    let (most, there) = match job.picture.memory {
        Some(most) => (most, format!("--memory is {}", megabytes(most))),
        None => {
            let beside = progress.crew().map_or(Ok(1), |crew| crew.beside(progress))?;
            let Some(free) = room::free().map(|free| free / beside) else { return Ok(()) };
            let each = if beside > 1 { format!(" for each of {beside} ranks on this host") } else { String::new() };
            (free, format!("{} are free{each}", megabytes(free)))
        }
    };
    missing(job.photons, most, &there, duality).map_or(Ok(()), Err)
}

fn megabytes(bytes: u64) -> String {
    format!("{:.1} MB", bytes as f64 / 1e6)
}

/// Why so many photons do not fit into the `most` bytes that are `there`.
fn missing(photons: u64, most: u64, there: &str, duality: bool) -> Option<Error> {
    let bytes = photons.saturating_mul(EACH);
    let (takes, fitting) = (megabytes(bytes), most / EACH);
    let grid = if duality { "--density source with --integrator grid" } else { "--integrator grid" };
    (bytes > most).then(|| Error::Machine {
        reason: format!("--photons {photons} takes {takes} of memory, {EACH} bytes a photon that every process holds, and {there}"),
        fix: format!(
            "Use --photons {fitting} or fewer, more --memory where there is more, or {grid}, whose memory does not depend on photons"
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photons_that_just_fit_are_stored_and_one_more_is_refused() {
        assert!(missing(1_000_000, 47_000_000, "", true).is_none());
        let said = |photons, duality| missing(photons, 47_000_000, "--memory is 47.0 MB", duality).unwrap().to_string();
        let duality = said(2_000_000, true);
        assert!(duality.starts_with("--photons 2000000 takes 94.0 MB of memory, 47 bytes a photon"), "{duality}");
        assert!(
            duality.contains("--memory is 47.0 MB. Use --photons 1000000 or fewer") && duality.contains("--density source"),
            "{duality}"
        );
        assert!(!said(1_000_001, false).contains("--density"));
        assert!(missing(u64::MAX, u64::MAX - 1, "", true).is_some());
    }
}
