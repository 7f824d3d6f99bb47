//! The loop of a training run.
//!
//! ```text
//! samples of (seed, n) → train × accumulate → apply → figures, every so often validation and a checkpoint
//! ```
//!
//! A run goes on from the checkpoint in its folder until it has done a number of steps in all. Since a step is a function of the
//! state before it and of (seed, number of the step), a run that is killed and started again takes the same steps as one that is
//! not, to the bit. When it is asked to stop, it gives up the step it is in, saves, and leaves.
//!
//! The first number that is NaN or infinite ends the run before it can reach a checkpoint: losses and the gradient's norm are looked at in every
//! step, and all numbers when they are saved. A checkpoint that cannot be written (a full disk) does not end it: the former one stays, the
//! next one is tried when it is due, and the run fails at the end if the last attempt did.

#[cfg(test)]
mod fake;
#[cfg(test)]
mod tests;

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use omnix_eval::network::Figures;

use crate::TrainError;
use crate::checkpoint::{Best, Progress, changed_settings, save, save_best};
use crate::ended::{Ended, agree, same_device};
use crate::groups::Group;
use crate::interface::{LossValues, Step, Update};
use crate::loader::Loader;
use crate::mixture::{Drawn, Mixture};
use crate::peers::{Peers, Turns};
use crate::report::{Report, StepFigures};
use crate::session::Session;

/// What happens in a run, as it happens.
#[derive(Debug)]
#[non_exhaustive]
pub enum Event<'a> {
    /// It goes on from a checkpoint.
    Continued {
        /// Steps done.
        step: u64,
    },
    /// Something that the user should know.
    Note(String),
    /// A step is done.
    Step {
        /// Its figures.
        figures: &'a StepFigures,
        /// Steps in all.
        of: u64,
        /// Time left, by the mean of this process's steps.
        left: Duration,
    },
    /// The validation samples were gone through.
    Validated {
        /// Steps done.
        step: u64,
        /// The mean over the samples.
        losses: &'a LossValues,
        /// What `omnix eval network` measures, by the names of its columns ([`omnix_eval::network`]): those that these samples have.
        figures: &'a [(&'static str, f64)],
        /// Whether it is the best so far.
        best: bool,
    },
    /// A checkpoint is on the disk.
    Saved {
        /// Steps done.
        step: u64,
    },
    /// A checkpoint could not be written; the former one is as it was.
    SaveFailed {
        /// Why.
        error: &'a TrainError,
    },
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outcome {
    /// Steps done in all.
    pub step: u64,
    /// Whether it was asked to stop before the end.
    pub stopped: bool,
    /// The best validation.
    pub best: Option<Best>,
}

/// How to run, beside what the recipe says: made by [`RunOptions::new`] and changed by the methods of its fields' names.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct RunOptions<'a> {
    /// Steps in all, those of the checkpoint included; the schedule's length stays that of the recipe.
    pub until: u64,
    /// Threads that make samples; any number gives the same bits.
    pub threads: usize,
    /// Set when the run shall stop.
    pub stop: &'a AtomicBool,
    /// The other processes of this training, where there are any.
    pub peers: Option<&'a dyn Peers>,
}

impl<'a> RunOptions<'a> {
    /// This number of steps in all, in one process, with one thread that makes samples.
    #[must_use]
    pub const fn new(until: u64, stop: &'a AtomicBool) -> Self {
        Self { until, threads: 1, stop, peers: None }
    }

    /// Threads that make samples.
    #[must_use]
    pub const fn threads(self, threads: usize) -> Self {
        Self { threads, ..self }
    }

    /// The other processes of this training.
    #[must_use]
    pub const fn peers(self, peers: Option<&'a dyn Peers>) -> Self {
        Self { peers, ..self }
    }
}

/// The page is written anew at most this often between checkpoints.
const PAGE_EVERY: Duration = Duration::from_secs(15);

/// Trains until enough steps are done or the run is asked to stop. `step` has the session's start values.
///
/// # Errors
/// Processes on devices of different kinds, a sample that cannot be had, a step that fails, a number that is NaN or infinite, reports that cannot be written, or a last
/// checkpoint that cannot.
pub fn run(
    session: &mut Session,
    step: &mut dyn Step,
    options: RunOptions<'_>,
    each: &mut dyn FnMut(&Event<'_>),
) -> Result<Outcome, TrainError> {
    if let Some(peers) = options.peers {
        same_device(peers, &step.device())?;
    }
    let config = session.recipe().config.clone();
    let progress = restored(session, step, each)?;
    let idle = step.layout().idle.iter().filter_map(|index| config.group.get(*index));
    // The release's groups may be more than a network has parts.
    if config.group != Group::release() {
        idle.for_each(|group| each(&Event::Note(format!("no tensor's name has the group \"{}\"", group.name))));
    }
    let names: Vec<String> = config.group.iter().map(|group| group.name.clone()).collect();
    let title = &session.recipe().network.name;
    let open = || Report::open(session.out(), progress.step, title, &config.settings(), &names);
    let report = if session.leads() { Some(open()?) } else { None };
    let turns = Turns::new(progress.samples, config.optimiser.accumulate, options.peers);
    let loader = Loader::new(Mixture::of(&config, false)?, turns, options.threads);
    let tried = progress.step;
    let exchanged = progress.step;
    let mut running = Running {
        session,
        progress,
        report,
        step,
        loader,
        tried,
        exchanged,
        told: false,
        failed: None,
        time: Times::new(),
    };
    if let Err(error) = running.go(options, each) {
        running.tell(options, &error);
        // The weights are good: what was learned since the last checkpoint is not lost.
        let good = matches!(error, TrainError::Sample { .. } | TrainError::Write { .. } | TrainError::Peer { .. });
        let saved = if good && running.progress.step != running.tried { running.save(false, each) } else { Ok(()) };
        if let Some(peers) = options.peers.filter(|_| running.told) {
            // Nobody leaves, which may end the others, before the first has saved. The first error is the one to tell.
            let _ = peers.gather(&[]);
        }
        return Err(saved.err().unwrap_or(error));
    }
    let Running { progress, failed, .. } = running;
    let stopped = progress.step < options.until;
    match failed {
        Some(error) => Err(error),
        None => Ok(Outcome { step: progress.step, stopped, best: progress.best }),
    }
}

/// Gives the checkpoint, if there is one, to the step.
fn restored(
    session: &mut Session,
    step: &mut dyn Step,
    each: &mut dyn FnMut(&Event<'_>),
) -> Result<Progress, TrainError> {
    let config = &session.recipe().config;
    let settings = config.settings();
    let Some(saved) = session.saved() else { return Ok(Progress::new(config.seed, settings)) };
    saved.restore(step, config.averaged())?;
    let mut progress = saved.progress().clone();
    each(&Event::Continued { step: progress.step });
    for change in changed_settings(&progress.settings, &settings) {
        each(&Event::Note(format!("the run goes on with another setting: {change}")));
    }
    (progress.seed, progress.settings) = (config.seed, settings);
    progress.version = env!("CARGO_PKG_VERSION").to_owned();
    session.forget_saved();
    Ok(progress)
}

struct Times {
    start: Instant,
    page: Instant,
    save: Instant,
    /// Steps done by this process.
    steps: u32,
}

impl Times {
    fn new() -> Self {
        let now = Instant::now();
        Self { start: now, page: now, save: now, steps: 0 }
    }
}

/// The losses of samples, and the last of this process's.
type Taken = (Vec<LossValues>, Option<Drawn>);

struct Running<'a> {
    session: &'a Session,
    progress: Progress,
    /// None where another process leads.
    report: Option<Report>,
    step: &'a mut dyn Step,
    loader: Loader,
    /// The step after which saving was last tried, or that the run goes on from.
    tried: u64,
    /// The last step of which the gradients of all processes were added up.
    exchanged: u64,
    /// Whether all processes know that the run has failed.
    told: bool,
    /// Why the last attempt to save failed.
    failed: Option<TrainError>,
    time: Times,
}

impl Running<'_> {
    fn go(&mut self, options: RunOptions<'_>, each: &mut dyn FnMut(&Event<'_>)) -> Result<(), TrainError> {
        let config = self.session.recipe().config.clone();
        while self.progress.step < options.until {
            let begun = Instant::now();
            let Some(mut figures) = self.one(options)? else { break };
            let seconds = begun.elapsed().as_secs_f64();
            figures.seconds = seconds;
            self.progress.seconds += seconds;
            if let Some(report) = &mut self.report {
                report.step(&figures)?;
            }
            self.time.steps += 1;
            let left = u32::try_from(options.until - self.progress.step).unwrap_or(u32::MAX);
            let left = (self.time.start.elapsed() / self.time.steps).saturating_mul(left);
            each(&Event::Step { figures: &figures, of: options.until, left });

            let step = self.progress.step;
            let last = step == options.until;
            let due = config.validation.as_ref().is_some_and(|v| last || step.is_multiple_of(v.every));
            let best = due && self.validate(each)?;
            if self.save_due(last || best && config.keeps_best()) {
                self.save(best && config.keeps_best(), each)?;
                self.page(options.until)?;
            } else if self.time.page.elapsed() > PAGE_EVERY {
                self.page(options.until)?;
            }
        }
        // Stopped between two checkpoints.
        if self.progress.step != self.tried {
            self.save(false, each)?;
        }
        self.page(options.until)
    }

    /// One step; none when the run is asked to stop meanwhile. Its seconds are the caller's.
    fn one(&mut self, options: RunOptions<'_>) -> Result<Option<StepFigures>, TrainError> {
        let number = self.progress.step + 1;
        let part = self.part(number, options.stop);
        let (samples, last) = match options.peers {
            None => match part? {
                None => return Ok(None),
                Some(part) => part,
            },
            Some(peers) => match self.exchanged(part, peers)? {
                None => return Ok(None),
                Some(all) => all,
            },
        };
        let config = &self.session.recipe().config;
        let count = samples.len() as u32;
        let mut losses = LossValues::default();
        samples.iter().for_each(|found| losses.add(found, 1.0 / f64::from(count)));
        let factor = config.schedule.factor(self.progress.step, config.steps);
        let rate = |group: &Group| if group.frozen { 0.0 } else { factor * group.rate.unwrap_or(0.0) };
        let update = Update {
            step: number,
            samples: count,
            rates: config.group.iter().map(rate).collect(),
            decays: config.group.iter().map(|group| config.decay(group)).collect(),
            clip: (config.optimiser.clip > 0.0).then_some(config.optimiser.clip),
            average: config.averaged().then_some(config.optimiser.average),
        };
        let norm = self.step.apply(&update).map_err(TrainError::Step)?;
        if let (false, Some(drawn)) = (norm.is_finite(), &last) {
            let of = if options.peers.is_some_and(|peers| peers.count() > 1) { " of all processes" } else { "" };
            return Err(not_finite(self.step, format!("the norm of the gradient{of}"), number, drawn));
        }
        self.progress.step = number;
        self.progress.samples += u64::from(count);
        Ok(Some(StepFigures { step: number, losses, norm, rates: update.rates, seconds: 0.0 }))
    }

    /// This process's samples of a step: the losses of each, and the last of them; none when the run is asked to stop meanwhile.
    fn part(&mut self, number: u64, stop: &AtomicBool) -> Result<Option<Taken>, TrainError> {
        let count = self.session.recipe().config.optimiser.accumulate;
        let (mut losses, mut last) = (Vec::new(), None);
        for _ in 0..count {
            if stop.load(Ordering::SeqCst) {
                return Ok(None);
            }
            let drawn = self.loader.take()?;
            let found = self.step.train(&drawn.sample, drawn.number).map_err(TrainError::Step)?;
            if let Some(name) = found.not_finite() {
                let loss = format!("the loss \"{name}\"");
                return Err(not_finite(self.step, loss, number, &drawn));
            }
            losses.push(found);
            last = Some(drawn);
        }
        Ok(Some((losses, last)))
    }

    /// The step's losses of all processes, once their gradients are added up in each; none where one of them was asked to stop.
    fn exchanged(
        &mut self,
        part: Result<Option<Taken>, TrainError>,
        peers: &dyn Peers,
    ) -> Result<Option<Taken>, TrainError> {
        let mine = match &part {
            Ok(Some((losses, _))) => Ended::done(losses),
            Ok(None) => Ended::Stopped,
            Err(error) => Ended::failed(error),
        };
        let names = part.as_ref().ok().and_then(Option::as_ref).map_or(&[][..], |(losses, _)| losses);
        let all = agree(peers, &mine, names);
        self.told = part.is_err() || all.is_err();
        // Its own failure says more than what the others are told of it.
        let part = part?;
        let (Some(losses), Some((_, last))) = (all?, part) else {
            // All leave now: nobody will ask any more.
            self.exchanged = u64::MAX;
            return Ok(None);
        };
        self.step.exchange(peers).map_err(TrainError::Step)?;
        self.exchanged = self.progress.step + 1;
        Ok(Some((losses, last)))
    }

    /// Tells the other processes of a failure that they do not know of, where they will ask: before the exchange of their next step.
    fn tell(&mut self, options: RunOptions<'_>, error: &TrainError) {
        let Some(peers) = options.peers.filter(|_| !self.told) else { return };
        // A failure between the start of an exchange and its end has cut it off: then the host ends the others.
        let within = self.exchanged == self.progress.step && matches!(error, TrainError::Step(_));
        if self.exchanged < options.until && !within {
            self.told = agree(peers, &Ended::failed(error), &[]).is_err();
        }
    }

    /// Goes through the validation samples; whether the result is the best so far.
    fn validate(&mut self, each: &mut dyn FnMut(&Event<'_>)) -> Result<bool, TrainError> {
        let config = &self.session.recipe().config;
        let Some(validation) = config.validation.as_ref().filter(|_| self.session.leads()) else { return Ok(false) };
        let mixture = Mixture::of(config, true)?;
        let (mut losses, mut figures) = (LossValues::default(), Figures::default());
        for number in 0..u64::from(validation.samples) {
            let drawn = mixture.draw(number)?;
            let (found, judged) = self.step.validate(&drawn.sample, config.averaged()).map_err(TrainError::Step)?;
            losses.add(&found, 1.0 / f64::from(validation.samples));
            if let Some((mut score, trivial)) = judged {
                if config.sample.scenes > 1 {
                    // Cameras of different scenes have no place to each other.
                    (score.rotation, score.direction) = (f64::NAN, f64::NAN);
                }
                figures.add(&drawn.label, (score, trivial));
            }
        }
        let figures = figures.means();
        let (step, figure) = (self.progress.step, losses.total);
        let best = figure.is_finite() && self.progress.best.is_none_or(|best| figure < best.figure);
        if best {
            self.progress.best = Some(Best { step, figure });
        }
        if let Some(report) = &mut self.report {
            report.validation(step, &losses, &figures)?;
        }
        each(&Event::Validated { step, losses: &losses, figures: &figures, best });
        Ok(best)
    }

    fn save_due(&self, must: bool) -> bool {
        let checkpoints = self.session.recipe().config.checkpoint;
        let by_steps = checkpoints.every_steps > 0 && self.progress.step.is_multiple_of(checkpoints.every_steps);
        let minutes = self.time.save.elapsed().as_secs_f64() / 60.0;
        must || by_steps || checkpoints.every_minutes > 0.0 && minutes >= checkpoints.every_minutes
    }

    /// Saves; a failure of the disk is kept for the end of the run, any other ends it.
    fn save(&mut self, best: bool, each: &mut dyn FnMut(&Event<'_>)) -> Result<(), TrainError> {
        if !self.session.leads() {
            (self.time.save, self.tried) = (Instant::now(), self.progress.step);
            return Ok(());
        }
        let (out, network) = (self.session.out(), &self.session.recipe().network_json);
        let averaged = self.session.recipe().config.averaged();
        let saved = save(out, network, &self.progress, self.step, averaged);
        let saved = saved.and_then(|()| if best { save_best(out) } else { Ok(()) });
        (self.time.save, self.tried) = (Instant::now(), self.progress.step);
        match saved {
            Ok(()) => {
                self.failed = None;
                each(&Event::Saved { step: self.tried });
            }
            Err(error @ (TrainError::StateNotFinite { .. } | TrainError::Step(_))) => return Err(error),
            Err(error) => {
                each(&Event::SaveFailed { error: &error });
                self.failed = Some(error);
            }
        }
        Ok(())
    }

    fn page(&mut self, until: u64) -> Result<(), TrainError> {
        self.time.page = Instant::now();
        let Some(report) = &mut self.report else { return Ok(()) };
        let Progress { step, samples, best, seconds, seed, .. } = &self.progress;
        let layout = self.step.layout();
        let mut facts = vec![
            ("steps", format!("{step} of {until}")),
            ("samples", samples.to_string()),
            ("time", format!("{:.1} minutes", seconds / 60.0)),
            ("seed", seed.to_string()),
            ("trained numbers", layout.parameters().to_string()),
        ];
        if let Some(Best { step, figure }) = best {
            facts.push(("best validation", format!("{figure:.6} after {step} steps")));
        }
        report.page(&facts)
    }
}

fn not_finite(machine: &mut dyn Step, what: String, step: u64, drawn: &Drawn) -> TrainError {
    let what = match machine.not_finite() {
        Some(tensor) => format!("{what} (first in {tensor})"),
        None => what,
    };
    TrainError::NotFinite { what, step, sample: drawn.number, label: drawn.label.clone() }
}
