//! The last records of a joint fit, gone through once more with every account of them open.
//!
//! The fit decides what became of each record from all of its heliostat's. About the last of them little came
//! after: whether a zero point jumped or a spot was found in a wrong place is then often open, and what is stated
//! of the heliostat has to hold both. The records up to these are believed as decided; these are taken in one by
//! one as those of a followed field are ([`told_by`]), and the accounts that are left are carried on.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::belief::{Belief, Shape, Told, column};
use super::follow::{Alarm, mixture_of};
use super::group::{Beliefs, Group, Prior};
use super::hyper::{Marks, waited};
use super::hypotheses::{Account, DECIDED_AFTER, decide, told_by};
use super::rows::in_time;
use super::watch::Lately;
use super::{BLOCK, Decided, Places, Work};

/// Records at the end of a heliostat's that are gone through again: of one before them, so many came after it that the
/// accounts of it are decided in a followed field too.
pub(super) const LAST: usize = DECIDED_AFTER;
/// The last records are gone through again where one of them is farther from what was expected (chi-squared, two degrees of
/// freedom: 1 % lie beyond): what else might explain a nearer one is less than a hundredth as likely as that it is right.
const OPENED: f64 = 9.21;
/// Of fewer records one more may always lie in a wrong place without standing out.
const FEW: usize = 9;
/// An account that is less likely than the best by this (logarithm) after the last record is not carried on: a thousandth. While
/// records are gone through more is kept (`GIVEN_UP`), as those to come may speak for it; of a young field nearly every
/// heliostat would be carried on in several accounts, at twice the time and size of an update.
const LEFT: f64 = 7.0;

/// What may have become of a heliostat's last records.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Open {
    /// Likeliest first; their marks count from the first of `days`.
    pub accounts: Vec<Account>,
    /// Days of the records that are gone through again and tell something \[since 1970\].
    pub days: Vec<f64>,
    /// All accounts together.
    pub belief: Belief<f64>,
    /// Of all records, in time, as the likeliest account has them.
    pub marks: Marks,
}

impl Work<'_> {
    /// Heliostats whose last records leave more than one account, or another one than was decided.
    pub(super) fn reopen(
        &self,
        places: &Places,
        known: &[Beliefs],
        decided: &Decided,
    ) -> BTreeMap<usize, Open> {
        let causes = &self.live.causes;
        let prior = Prior::new(self.shape, &self.hyper, &self.common.mean, causes);
        let with_known = self.order.iter().enumerate();
        let some: Vec<(usize, &[usize])> = with_known
            .filter(|(n, k)| self.is_open(**k, &known[n / BLOCK], n % BLOCK, decided))
            .map(|(n, &k)| (k, &known[n / BLOCK].silent[n % BLOCK][..]))
            .collect();
        let each: Vec<Vec<(usize, Open)>> = some
            .par_chunks(BLOCK)
            .map_init(Group::default, |group, some| {
                self.reopen_some(group, some, places, &prior, decided)
            })
            .collect();
        each.into_iter().flatten().collect()
    }

    fn is_open(&self, k: usize, known: &Beliefs, lane: usize, decided: &Decided) -> bool {
        let count = self.campaigns[k].observations.len();
        let marked = || {
            let marks = decided.get(&k);
            marks.is_some_and(|marks| marks.from(count.saturating_sub(LAST)) != Marks::default())
        };
        count > 0 && (count < FEW || known.farthest_last[lane] > OPENED || marked())
    }

    fn reopen_some(
        &self,
        group: &mut Group,
        some: &[(usize, &[usize])],
        places: &Places,
        prior: &Prior<'_>,
        decided: &Decided,
    ) -> Vec<(usize, Open)> {
        if !self.going.is_on() {
            return Vec::new();
        }
        let rows = self.live.structure.shape();
        let none = Marks::default();
        let members: Vec<usize> = some.iter().map(|(k, _)| *k).collect();
        self.linearise(group, &members, places);
        let mut last: [Vec<f64>; BLOCK] = Default::default();
        for (lane, k) in members.iter().enumerate() {
            let count = self.campaigns[*k].observations.len();
            let first = count.saturating_sub(LAST);
            last[lane] = group.records_of(rows, lane, first..count);
            let marks = decided.get(k).unwrap_or(&none).until(first);
            group.mark(rows, lane, &marks, self.options.mishaps.jump_mrad);
            group.end(rows, lane, first);
        }
        let mut until = Beliefs::default();
        group.filter(self.level, prior, &mut until);
        let each = some.iter().zip(&last).enumerate();
        each.filter_map(|(lane, (&(k, silent), last))| {
            let marks = decided.get(&k).unwrap_or(&none);
            let belief = until.belief(self.shape, lane);
            let open = self.go_through(k, belief, last, marks, silent)?;
            Some((k, open))
        })
        .collect()
    }

    /// Takes in the last records of heliostat `k`, of which it has what is known before them; `None` where nothing comes
    /// out but what was decided.
    fn go_through(
        &self,
        k: usize,
        belief: Belief<f64>,
        last: &[f64],
        decided: &Marks,
        silent: &[usize],
    ) -> Option<Open> {
        let rows = self.live.structure.shape();
        let rest = self.shape.row() - column::REST;
        let (_, days) = in_time(&self.campaigns[k]);
        let first = days.len() - last.len() / rows.row();
        let rates = self.hyper.rates();
        let before = decided.until(first);
        let silent_before: Vec<usize> = silent.iter().copied().filter(|r| *r < first).collect();
        let mut account = Account::new(belief);
        let odd = before.odd(first, &silent_before);
        account.lately = Lately::of(&odd);
        let unbelieved = |r: &usize| before.outliers.contains(r) || silent_before.contains(r);
        account.drift.unbelieved = (0..first).rev().take_while(unbelieved).count();
        let mut accounts = vec![account];
        let mut numbers = Vec::new();
        for (n, row) in last.chunks_exact(rows.row()).enumerate() {
            let row = self.widened(row);
            let (kept, added) = waited(&rates, row[rest + column::DAYS]);
            for account in &mut accounts {
                account.belief.wait(kept, added);
            }
            if row[rest + column::SILENT] != 0.0 {
                for account in &mut accounts {
                    account.unbelieved();
                }
                continue;
            }
            let number = numbers.len();
            numbers.push(first + n);
            accounts = told_by(
                accounts,
                number,
                &row,
                &rates,
                &self.options.mishaps,
                &self.common,
                Alarm::default().weight,
            );
            decide(&mut accounts, number);
        }
        accounts.retain(|account| account.log_likelihood > -LEFT);
        let likeliest = &accounts.first()?.marks;
        let of_numbers = likeliest.numbered(&numbers);
        if accounts.len() == 1 && of_numbers == decided.from(first) {
            return None;
        }
        let marks = before.and(of_numbers);
        for account in &mut accounts {
            // the sum over the field has it as it was decided
            account.told = Told::nothing(self.shape);
        }
        if let [only] = &mut accounts[..] {
            only.marks = Marks::default();
            numbers.clear();
        }
        Some(Open {
            belief: mixture_of(&accounts, &self.common).into_owned(),
            accounts,
            days: numbers.into_iter().map(|r| days[r]).collect(),
            marks,
        })
    }

    /// A linearised record with the causes that are held to zero, which do not move it.
    fn widened(&self, row: &[f64]) -> Vec<f64> {
        let Shape { still, causes, .. } = self.shape;
        let mut wide = vec![0.0; self.shape.row()];
        wide[..2 * still].copy_from_slice(&row[..2 * still]);
        let by_cause = row[2 * still..].as_chunks::<2>().0;
        for (&cause, slope) in self.live.causes.iter().zip(by_cause) {
            wide[2 * (still + cause)..][..2].copy_from_slice(slope);
        }
        let rest = 2 * (still + causes);
        let from = 2 * (still + self.live.causes.len());
        wide[rest..].copy_from_slice(&row[from..]);
        wide
    }
}
