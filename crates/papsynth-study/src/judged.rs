//! Trials with the answers to them.

use crate::design::{Side, Stage};
use crate::plan::{Plan, Trial};
use crate::saved::{Answered, Saved};

/// A trial and what was said to it.
#[derive(Clone, Copy)]
pub(crate) struct Judged<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) trial: &'a Trial,
    pub(crate) answered: &'a Answered,
}

impl Judged<'_> {
    /// Whether the first patch is real.
    pub(crate) fn is_positive(&self) -> bool {
        self.trial.patches.first().is_some_and(|patch| patch.side == Side::Real)
    }

    pub(crate) fn is_correct(&self) -> bool {
        self.is_positive() == self.answered.answer.is_positive()
    }
}

pub(crate) fn answered(saved: &Saved) -> impl Iterator<Item = Judged<'_>> {
    let pairs = saved.plan.trials.iter().zip(&saved.answers);
    pairs.map(|(trial, answered)| Judged { plan: &saved.plan, trial, answered })
}

pub(crate) fn counted(saved: &Saved) -> impl Iterator<Item = Judged<'_>> {
    answered(saved).filter(|judged| judged.trial.stage == Stage::Counted)
}
