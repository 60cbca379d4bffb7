//! Ranks that are threads of one process: the protocol without MPI.

use super::{Letter, Solo, Team, Wire};
use crate::error::{Error, Result};
use crate::integrate::flux::flux;
use crate::integrate::photon::PhotonSettings;
use crate::integrate::{Integrator, RenderSettings, render};
use crate::photon::{Model, Tracer};
use crate::plan::{Density, Plan};
use crate::progress::{Crew, Progress, Silent, agreed, share, tally};
use crate::scene::{Medium, Region, Scene, Shape, View};
use glam::DVec3;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Barrier, Mutex};

type Mail = (usize, Vec<u8>);
/// Where all meet: sums so far, and what rank 0 has said.
type Hall = (Barrier, Mutex<Vec<u64>>, Mutex<Vec<u8>>);

/// A rank's end of the pipes between all.
struct Pipes {
    rank: usize,
    to: Vec<Mutex<Sender<Mail>>>,
    from: Mutex<Receiver<Mail>>,
    hall: Arc<Hall>,
}

impl Wire for Pipes {
    fn rank(&self) -> usize {
        self.rank
    }

    fn size(&self) -> usize {
        self.to.len()
    }

    fn send(&self, to: usize, letter: &[u8]) {
        self.to[to].lock().unwrap().send((self.rank, letter.to_vec())).unwrap();
    }

    fn letter(&self) -> Option<Mail> {
        self.from.lock().unwrap().try_recv().ok()
    }

    fn spread(&self, bytes: &mut [u8]) {
        let (barrier, _, said) = &*self.hall;
        if self.rank == 0 {
            *said.lock().unwrap() = bytes.to_vec();
        }
        barrier.wait();
        bytes.copy_from_slice(&said.lock().unwrap());
        barrier.wait();
    }

    fn add(&self, numbers: &mut [u64]) {
        let (barrier, sums, _) = &*self.hall;
        {
            let mut sums = sums.lock().unwrap();
            sums.resize(numbers.len(), 0);
            sums.iter_mut().zip(&*numbers).for_each(|(sum, n)| *sum = sum.wrapping_add(*n));
        }
        barrier.wait();
        numbers.copy_from_slice(&sums.lock().unwrap());
        barrier.wait();
        sums.lock().unwrap().clear();
        barrier.wait();
    }
}

fn pipes(ranks: usize) -> Vec<Pipes> {
    let hall: Arc<Hall> = Arc::new((Barrier::new(ranks), Mutex::default(), Mutex::default()));
    let (to, from): (Vec<Sender<Mail>>, Vec<Receiver<Mail>>) = (0..ranks).map(|_| channel()).unzip();
    let one =
        |(rank, from)| Pipes { rank, to: to.iter().cloned().map(Mutex::new).collect(), from: Mutex::new(from), hall: Arc::clone(&hall) };
    from.into_iter().enumerate().map(one).collect()
}

/// A rank of a run, which may be stopped.
struct Rank {
    team: Team,
    stop: Arc<AtomicBool>,
}

impl Progress for Rank {
    fn begin(&self, _: &'static str, _: u64) {}

    fn at(&self, _: u64) {}

    fn cancelled(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn crew(&self) -> Option<&dyn Crew> {
        Some(&self.team)
    }
}

/// What `run` gives on each of so many ranks.
fn together<T: Send>(ranks: usize, checkpoint: Option<&Path>, run: impl Fn(&Rank) -> T + Sync) -> Vec<T> {
    let stop = Arc::new(AtomicBool::new(false));
    let team = |wire: Box<dyn Wire>| {
        let team = Team::new(wire);
        checkpoint.into_iter().for_each(|file| team.keep_in(file));
        Rank { team, stop: Arc::clone(&stop) }
    };
    let ranks: Vec<Rank> = match ranks {
        1 => vec![team(Box::new(Solo))],
        _ => pipes(ranks).into_iter().map(|pipes| team(Box::new(pipes))).collect(),
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = ranks.iter().map(|rank| scope.spawn(|| run(rank))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    })
}

#[test]
fn each_item_is_done_once_and_every_rank_has_all_in_order() {
    for ranks in 1..=4 {
        let done: Vec<AtomicU64> = (0..3000).map(|_| AtomicU64::new(0)).collect();
        let one = |item: u64| {
            done[item as usize].fetch_add(1, Ordering::Relaxed);
            vec![item; (item % 3) as usize + 1]
        };
        let told = AtomicU64::new(0);
        let all = together(ranks, None, |rank| {
            // A second meeting comes upon letters of the first.
            let first = share(100..3000, one, rank, |done| _ = told.fetch_max(done, Ordering::Relaxed)).unwrap();
            let second = share(0..100, one, rank, |_| ()).unwrap();
            let none = share(5..5, one, rank, |_| ()).unwrap();
            (second.into_iter().chain(first).collect::<Vec<Vec<u64>>>(), none.len())
        });
        let expected: Vec<Vec<u64>> = (0..3000).map(|item| vec![item; (item % 3) as usize + 1]).collect();
        assert!(all.iter().all(|(values, none)| *values == expected && *none == 0), "{ranks}");
        assert!(done.iter().all(|n| n.load(Ordering::Relaxed) == 1) && told.load(Ordering::Relaxed) == 2900, "{ranks}");
    }
}

#[test]
fn sums_are_those_of_all_and_below_zero_too() {
    for ranks in 1..=4 {
        let all = together(ranks, None, |rank| {
            let sums: Vec<AtomicU64> = (0..5000).map(|_| AtomicU64::new(0)).collect();
            // Bricks in the middle stay untouched.
            let one = |item: u64| {
                sums[(item % 7) as usize].fetch_add(item, Ordering::Relaxed);
                sums[4999].fetch_add((-(item as i64)) as u64, Ordering::Relaxed);
            };
            tally(0..1000, one, &sums, rank, |_| ()).unwrap();
            sums.into_iter().map(|n| n.into_inner() as i64).collect::<Vec<_>>()
        });
        let mut expected = vec![0; 5000];
        (0..1000).for_each(|item| expected[(item % 7) as usize] += item);
        expected[4999] = -499_500;
        assert!(all.iter().all(|sums| *sums == expected), "{ranks}");
    }
}

#[test]
fn clocks_are_those_of_rank_0_and_what_differs_is_refused_everywhere() {
    let said = together(3, None, |rank| agreed([rank.team.wire.rank() as f64, 5.0], rank).unwrap());
    assert_eq!(said, [[0.0, 5.0]; 3]);
    let met = together(3, None, |rank| {
        let same = rank.team.meet("a scene", rank).is_ok();
        let other = if rank.team.wire.rank() == 1 { "another" } else { "a scene" };
        (same, rank.team.meet(other, rank).unwrap_err().to_string())
    });
    assert!(met.iter().all(|(same, error)| *same && error.starts_with("1 of 3 ranks read another scene")), "{met:?}");
}

#[test]
fn letters_are_read_as_they_were_written_and_else_not() {
    let letters = [
        Letter::Want { meeting: 3, threads: 2 },
        Letter::Grant { meeting: 3, items: [5, 9] },
        Letter::Done { meeting: 4, out: vec![(7, b"seven".to_vec()), (8, Vec::new())] },
        Letter::Ended { meeting: u64::MAX },
        Letter::Come,
        Letter::Over,
    ];
    for letter in letters {
        let bytes = letter.bytes();
        assert!(Letter::read(&bytes[..bytes.len() - 1]).is_none(), "{letter:?}");
        assert_eq!(Letter::read(&bytes), Some(letter));
    }
    assert!(Letter::read(&[9; 32]).is_none());
}

/// Two coloured balls over a ground, under a sky.
fn scene() -> Scene {
    let ball = |name: &str, x: f64, albedo: [f64; 3]| Region {
        name: name.into(),
        shape: Shape::sphere(DVec3::new(x, 0.0, 2.0), 1.5),
        medium: Medium { sigma_s: albedo.map(|a| 4.0 * a), sigma_a: albedo.map(|a| 4.0 * (1.0 - a)), g: 0.7 },
        photons: None,
    };
    Scene { regions: vec![ball("a", -1.0, [1.0, 0.95, 0.9]), ball("b", 1.0, [0.99; 3])], sky: [0.1, 0.2, 0.3], ..Scene::default() }
}

/// Everything that is shared gives the same on any number of ranks, bit for bit.
#[test]
fn pictures_photons_and_balances_are_those_of_one_process() {
    let scene = scene();
    let plan = Plan::for_scene(&scene, Density::Source);
    let framed = View { size: Some([40, 30]), ..View::default() }.frame(&scene).unwrap();
    let all = |progress: &dyn Progress| {
        let picture = |integrator: Integrator| {
            let photon = PhotonSettings { photons: 20_000, ..PhotonSettings::default() };
            let settings = RenderSettings { integrator, width: 40, height: 30, spp: 4, seed: 5, photon };
            let rendering = render(&scene, &plan, &framed.camera, &settings, None, progress).unwrap();
            (rendering.film, rendering.collisions)
        };
        let pictures = [Integrator::Path, Integrator::Photon, Integrator::Grid].map(picture);
        let shot = Tracer::new(&scene, &plan, Model::Physical).fill(50_000, 9, progress).unwrap();
        let balance = flux(&scene, &plan, 40_000, 3, progress).unwrap();
        (pictures, shot.map.photons().to_vec(), (shot.emitted, shot.traced, shot.collisions, shot.energy), balance)
    };
    let alone = all(&Silent);
    for ranks in 1..=3 {
        for (rank, theirs) in together(ranks, None, |rank| all(rank)).into_iter().enumerate() {
            assert!(theirs.0 == alone.0, "pictures of rank {rank} of {ranks}");
            assert!(theirs.1 == alone.1 && theirs.2 == alone.2, "photons of rank {rank} of {ranks}");
            assert!(theirs.3 == alone.3, "balance of rank {rank} of {ranks}");
        }
    }
}

/// A run that is stopped goes on with what it has done, on another number of ranks, to the same result.
#[test]
fn what_is_kept_is_not_done_again() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.checkpoint");
    let done = AtomicU64::new(0);
    let run = |rank: &Rank, until: u64| -> Result<(Vec<u64>, Vec<u64>)> {
        rank.team.meet("a run", rank)?;
        let sums: Vec<AtomicU64> = (0..600).map(|_| AtomicU64::new(0)).collect();
        let one = |item: u64| {
            if done.fetch_add(1, Ordering::Relaxed) >= until {
                rank.stop.store(true, Ordering::Relaxed);
            }
            sums[(item % 600) as usize].fetch_add(item, Ordering::Relaxed);
        };
        tally(0..500, one, &sums, rank, |_| ())?;
        let value = |item: u64| {
            one(item);
            vec![item * item]
        };
        let values = share(0..500, value, rank, |_| ())?;
        Ok((values.concat(), sums.iter().map(|n| n.load(Ordering::Relaxed)).collect()))
    };
    for (ranks, until) in [(1, 200), (1, 700), (2, 100)] {
        done.store(0, Ordering::Relaxed);
        let stopped = together(ranks, Some(&file), |rank| run(rank, until));
        assert!(matches!(stopped[0], Err(Error::Interrupted)), "{ranks} {until}");
    }
    done.store(0, Ordering::Relaxed);
    let whole = together(3, Some(&file), |rank| run(rank, u64::MAX).unwrap().0);
    // The sums and some of the others were kept.
    let again = done.load(Ordering::Relaxed);
    assert!(again > 0 && again < 350, "{again}");
    let expected: Vec<u64> = (0..500).map(|item| item * item).collect();
    assert!(whole.iter().all(|values| *values == expected));
    // All is kept by now: a sum is there though nothing adds to it.
    done.store(0, Ordering::Relaxed);
    let known = together(2, Some(&file), |rank| run(rank, u64::MAX).unwrap());
    assert!(known.iter().all(|(values, sums)| *values == expected && sums[499] == 499 && sums[599] == 0));
    assert_eq!(done.load(Ordering::Relaxed), 0);
}
