//! How a process's part of a step ended, as it is told to the others that train with it.

use serde::{Deserialize, Serialize};

use crate::TrainError;
use crate::interface::LossValues;
use crate::peers::Peers;

/// How a process's part of a step ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) enum Ended {
    /// With the losses of each of its samples: the total and the terms in their order, as bits, so that no digit is lost.
    Done(Vec<Vec<u64>>),
    /// It was asked to stop.
    Stopped,
    /// It failed.
    Failed {
        /// The machine.
        host: String,
        /// Why, with all causes.
        reason: String,
    },
}

impl Ended {
    pub(crate) fn done(losses: &[LossValues]) -> Self {
        let bits = |found: &LossValues| {
            [found.total]
                .iter()
                .chain(found.terms.iter().map(|(_, value)| value))
                .map(|value| value.to_bits())
                .collect()
        };
        Self::Done(losses.iter().map(bits).collect())
    }

    pub(crate) fn failed(error: &TrainError) -> Self {
        let mut reason = error.to_string();
        let mut cause = std::error::Error::source(error);
        while let Some(next) = cause {
            reason = format!("{reason}: {next}");
            cause = next.source();
        }
        Self::Failed { host: host(), reason }
    }
}

/// The losses of all samples of a step, in their order; none where a process was asked to stop.
///
/// # Errors
/// The failure of another process, with its rank and machine.
pub(crate) fn agree(
    peers: &dyn Peers,
    mine: &Ended,
    terms: &[LossValues],
) -> Result<Option<Vec<LossValues>>, TrainError> {
    let all = peers.gather(&serde_json::to_vec(mine).unwrap_or_default())?;
    let mut losses = Vec::new();
    let mut stopped = false;
    for (rank, text) in (0..).zip(all) {
        let broken = |reason: String| TrainError::Peer { rank, host: "?".to_owned(), reason };
        match serde_json::from_slice(&text).map_err(|error| broken(format!("its message cannot be read: {error}")))? {
            Ended::Done(samples) => losses.extend(samples.iter().map(|bits| named(bits, terms))),
            Ended::Stopped => stopped = true,
            Ended::Failed { host, reason } => return Err(TrainError::Peer { rank, host, reason }),
        }
    }
    Ok((!stopped).then_some(losses))
}

/// Checks that the processes compute on machines of the same words.
///
/// # Errors
/// The first that does not.
pub(crate) fn same_device(peers: &dyn Peers, mine: &str) -> Result<(), TrainError> {
    let all = peers.gather(mine.as_bytes())?;
    let mut all = all.iter().map(|words| String::from_utf8_lossy(words).into_owned());
    let expected = all.next().unwrap_or_default();
    match (1..).zip(all).find(|(_, found)| *found != expected) {
        Some((rank, found)) => Err(TrainError::PeerDevice { rank, found, expected }),
        None => Ok(()),
    }
}

/// Losses of another process with the names of this one's: all have the same terms.
fn named(bits: &[u64], like: &[LossValues]) -> LossValues {
    let mut values = bits.iter().map(|bits| f64::from_bits(*bits));
    let total = values.next().unwrap_or(f64::NAN);
    let names = like.first().map_or(&[][..], |found| &found.terms);
    LossValues { total, terms: names.iter().map(|(name, _)| name.clone()).zip(values).collect() }
}

/// The name of this machine.
fn host() -> String {
    let named = std::fs::read_to_string("/proc/sys/kernel/hostname").ok().or_else(|| std::env::var("HOSTNAME").ok());
    named.map_or_else(|| "?".to_owned(), |name| name.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peers::threads::together;

    fn losses(total: f64) -> LossValues {
        LossValues { total, terms: vec![("depth".to_owned(), total / 3.0), ("score".to_owned(), f64::NAN)] }
    }

    #[test]
    fn losses_come_in_the_order_of_samples_to_the_bit() {
        let all = together(3, |peers| {
            let mine = [losses(0.1 + f64::from(peers.rank())), losses(0.7)];
            agree(peers, &Ended::done(&mine), &mine).unwrap().unwrap()
        });
        for found in all {
            let totals: Vec<f64> = found.iter().map(|found| found.total).collect();
            assert_eq!(totals, [0.1, 0.7, 1.1, 0.7, 2.1, 0.7]);
            assert_eq!(
                (found[2].terms[0].clone(), found[2].terms[1].1.is_nan()),
                (("depth".to_owned(), 1.1 / 3.0), true)
            );
        }
    }

    #[test]
    fn one_that_fails_or_stops_stops_all() {
        let ended = |of_last: Ended| {
            together(2, |peers| {
                let mine = if peers.rank() == 1 { of_last.clone() } else { Ended::done(&[losses(1.0)]) };
                agree(peers, &mine, &[])
            })
        };
        for found in ended(Ended::Stopped) {
            assert!(matches!(found, Ok(None)));
        }
        let error =
            TrainError::Sample { number: 7, label: "ue".to_owned(), source: Box::new(TrainError::NothingTrains) };
        for found in ended(Ended::failed(&error)) {
            let text = found.unwrap_err().to_string();
            assert!(
                text.contains("process 1") && text.contains("sample 7, from ue") && text.contains("no tensor"),
                "{text}"
            );
        }
    }
}
