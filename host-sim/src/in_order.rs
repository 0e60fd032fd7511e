//! Many questions on all cores, answered in their own order.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

/// Answers that may wait, for each thread, until a slow one before them is done. Bounds memory; the
/// larger, the longer an answer can take before the other threads run out of work.
const WAITING_PER_THREAD: usize = 64;

/// Threads for [`for_each`]: as many as asked for, else as many as the environment variable
/// `RAYON_NUM_THREADS` says, else one for each core.
///
/// # Errors
/// When the system starts no more threads.
pub fn threads(asked_for: Option<usize>) -> Result<ThreadPool, ThreadPoolBuildError> {
    ThreadPoolBuilder::new().num_threads(asked_for.unwrap_or(0)).build()
}

/// Computes `answer` for each question on the threads of `pool`, and gives the answers to `take` on
/// the calling thread, each as soon as all before it are taken. `take` sees the same calls in the
/// same order for any number of threads.
///
/// At most 64 answers a thread are computed ahead of the one that is taken. A panic in `answer` is
/// passed on to the caller.
///
/// # Errors
/// The first one of `take`. Questions under way are finished, no other is begun.
pub fn for_each<Q: Sync, A: Send, E>(
    pool: &ThreadPool,
    questions: &[Q],
    answer: impl Fn(&Q) -> A + Sync,
    mut take: impl FnMut(A) -> Result<(), E>,
) -> Result<(), E> {
    let ahead = WAITING_PER_THREAD * pool.current_num_threads();
    let given_up = AtomicBool::new(false);
    pool.in_place_scope_fifo(|scope| {
        let mut questions = questions.iter();
        let mut waiting = VecDeque::with_capacity(ahead);
        loop {
            for question in questions.by_ref().take(ahead - waiting.len()) {
                let (sender, receiver) = mpsc::sync_channel(1);
                let (answer, given_up) = (&answer, &given_up);
                scope.spawn_fifo(move |_| {
                    if !given_up.load(Ordering::Relaxed) {
                        // Nobody listens any more once `take` has failed.
                        let _ = sender.send(answer(question));
                    }
                });
                waiting.push_back(receiver);
            }
            let Some(next) = waiting.pop_front() else { return Ok(()) };
            // Without an answer the thread has panicked, and the scope passes that on.
            let Ok(next) = next.recv() else { return Ok(()) };
            if let Err(error) = take(next) {
                given_up.store(true, Ordering::Relaxed);
                return Err(error);
            }
        }
    })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;
    use std::thread::sleep;
    use std::time::{Duration, Instant};

    use super::*;

    #[test]
    fn answers_keep_their_order_when_the_first_is_slow() {
        let pool = threads(Some(4)).expect("four threads");
        let questions: Vec<u64> = (0..1000).collect();
        let ahead = 4 * WAITING_PER_THREAD;
        let begun = AtomicUsize::new(0);
        let answer = |&question: &u64| {
            begun.fetch_add(1, Ordering::Relaxed);
            if question == 0 {
                // Until the other three have run out of work, and then some time for one too many.
                let patience = Instant::now() + Duration::from_secs(10);
                while begun.load(Ordering::Relaxed) < ahead && Instant::now() < patience {
                    sleep(Duration::from_millis(1));
                }
                sleep(Duration::from_millis(50));
            }
            question
        };
        let mut taken = Vec::new();
        let take = |answer| {
            if taken.is_empty() {
                assert_eq!(begun.load(Ordering::Relaxed), ahead);
            }
            taken.push(answer);
            Ok::<(), ()>(())
        };
        for_each(&pool, &questions, answer, take).expect("take has not failed");
        assert_eq!(taken, questions);
    }

    #[test]
    fn nothing_is_begun_after_a_failure() {
        let pool = threads(Some(2)).expect("two threads");
        let begun = AtomicUsize::new(0);
        let answer = |(): &()| {
            begun.fetch_add(1, Ordering::Relaxed);
            sleep(Duration::from_millis(10));
        };
        assert_eq!(for_each(&pool, &[(); 1000], answer, |()| Err("full")), Err("full"));
        // Two when the first failed, two on its way; a busy machine may be slow to tell.
        assert!(begun.load(Ordering::Relaxed) <= 20, "{begun:?}");
    }

    #[test]
    #[should_panic(expected = "question 7")]
    fn a_panic_is_passed_on() {
        let pool = threads(Some(2)).expect("two threads");
        let questions: Vec<u32> = (0..100).collect();
        let answer = |&question: &u32| assert_ne!(question, 7, "question 7");
        let _ = for_each(&pool, &questions, answer, |()| Ok::<(), ()>(()));
    }
}
