//! What threads count: quanta of power, in whole numbers.

use super::kernel::Grid;
use super::plan::Plan;
use crate::account::Account;
use crate::map::FluxMap;
use crate::receiver::Receiver;

/// The cell of rays that miss: a corner of the frame of a plane's grid, the first of the others.
pub(super) const SPILLED: usize = 0;

pub(super) struct Tally {
    /// Of a plane, its grid with a frame; of others, the bins after [`SPILLED`].
    pub cells: Vec<u64>,
    pub incoming: u64,
    pub shaded: u64,
    pub reflection_loss: u64,
    pub blocked: u64,
    /// Scratch: what stands in the way of the rays at hand.
    pub verdicts: Vec<u32>,
}

/// The cell of a bin.
pub(super) fn cell_of(receiver: &Receiver, bin: usize) -> usize {
    match receiver {
        Receiver::Plane(plane) => {
            let (row, column) = (bin / plane.columns(), bin % plane.columns());
            (row + 1) * (plane.columns() + 2) + column + 1
        }
        _ => bin + 1,
    }
}

impl Tally {
    pub(super) fn new(receiver: &Receiver) -> Self {
        let cells = match receiver {
            Receiver::Plane(plane) => Grid {
                columns: plane.columns() as u32,
                rows: plane.rows() as u32,
            }
            .cells(),
            other => other.bins() + 1,
        };
        Self {
            cells: vec![0; cells],
            incoming: 0,
            shaded: 0,
            reflection_loss: 0,
            blocked: 0,
            verdicts: Vec::new(),
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        for (to, from) in self.cells.iter_mut().zip(&other.cells) {
            *to += from;
        }
        self.incoming += other.incoming;
        self.shaded += other.shaded;
        self.reflection_loss += other.reflection_loss;
        self.blocked += other.blocked;
    }

    pub(super) fn into_map(self, receiver: &Receiver, plan: &Plan) -> FluxMap {
        let power = |quanta: u64| quanta as f64 * plan.quantum_w;
        let bins: Vec<u64> = (0..receiver.bins())
            .map(|bin| self.cells[cell_of(receiver, bin)])
            .collect();
        let received: u64 = bins.iter().sum();
        let all: u64 = self.cells.iter().sum();
        let account = Account {
            mirror_w: plan.mirror_w,
            incoming_w: power(self.incoming),
            shaded_w: power(self.shaded),
            reflection_loss_w: power(self.reflection_loss),
            blocked_w: power(self.blocked),
            spilled_w: power(all - received),
            received_w: power(received),
            rays: plan.rays,
            turned_away: plan.turned_away,
        };
        let power_w: Vec<f64> = bins.into_iter().map(power).collect();
        FluxMap::new(receiver, &power_w, account)
    }
}
