//! The wire between ranks that `mpirun` started: MPI, of which one thread does everything.

use super::wire::Wire;
use mpi::Threading;
use mpi::collective::{CommunicatorCollectives, Root, SystemOperation};
use mpi::environment::Universe;
use mpi::point_to_point::{Destination, MatchedReceiveVec, Source};
use mpi::topology::{Communicator, SimpleCommunicator};
use std::sync::{Mutex, PoisonError};

/// What a launcher leaves in the environment of those it starts.
const STARTED: [&str; 4] = ["OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK", "PMI_SIZE"];
/// MPI counts in `int`.
const MOST: usize = 1 << 30;

/// All ranks that `mpirun` started.
pub struct Mpi {
    /// Until ranks part.
    universe: Mutex<Option<Universe>>,
}

impl Mpi {
    /// Joins the others; `None` where no launcher started this process.
    pub fn join() -> Option<Self> {
        if !STARTED.iter().any(|name| std::env::var_os(name).is_some()) {
            return None;
        }
        let (universe, _) = mpi::initialize_with_threading(Threading::Funneled)?;
        Some(Mpi { universe: Mutex::new(Some(universe)) })
    }
}

impl Wire for Mpi {
    fn rank(&self) -> usize {
        SimpleCommunicator::world().rank() as usize
    }

    fn size(&self) -> usize {
        SimpleCommunicator::world().size() as usize
    }

    fn send(&self, to: usize, letter: &[u8]) {
        SimpleCommunicator::world().process_at_rank(to as i32).send(letter);
    }

    fn letter(&self) -> Option<(usize, Vec<u8>)> {
        let (bytes, status) = SimpleCommunicator::world().any_process().immediate_matched_probe()?.matched_receive_vec();
        Some((status.source_rank() as usize, bytes))
    }

    fn spread(&self, bytes: &mut [u8]) {
        let world = SimpleCommunicator::world();
        bytes.chunks_mut(MOST).for_each(|part| world.process_at_rank(0).broadcast_into(part));
    }

    fn add(&self, numbers: &mut [u64]) {
        let (world, own) = (SimpleCommunicator::world(), numbers.to_vec());
        for (own, sums) in own.chunks(MOST / 8).zip(numbers.chunks_mut(MOST / 8)) {
            world.all_reduce_into(own, sums, SystemOperation::sum());
        }
    }

    fn host(&self) -> String {
        mpi::environment::processor_name().unwrap_or_default()
    }

    fn part(&self) {
        drop(self.universe.lock().unwrap_or_else(PoisonError::into_inner).take());
    }

    fn end_all(&self, code: u8) {
        SimpleCommunicator::world().abort(code.into());
    }
}
