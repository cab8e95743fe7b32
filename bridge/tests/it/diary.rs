//! The diary: what is left in the flash of which sheet the printer was in, whatever the supply, age and wear
//! do to it.

use bridge::store::{End, Record, Store};
use model::flash::ModelFlash;
use model::seeded;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Sectors of the diary.
const DIARY: usize = 2;
const SECTOR: usize = 4096;
/// Records of a sector.
const RECORDS: u32 = 128;

fn record(job: u32, end: Option<End>) -> Option<Record> {
    Some(Record { job, stored: 0, end })
}

fn noted(flash: &ModelFlash) -> Option<Record> {
    Store::open(flash.clone()).noted()
}

/// A flash with so many jobs in its diary, all of them at their end.
fn with_jobs(count: u32, random: &mut ChaCha8Rng) -> (ModelFlash, Store<ModelFlash>) {
    let flash = ModelFlash::new(DIARY + 4, random);
    let mut store = Store::open(flash.clone());
    for job in 1..=count {
        // A bridge that never stands still between two jobs erases before a first byte.
        if random.random_bool(0.7) {
            store.make_room();
        }
        store.note_begin(job, 0);
        store.note_end(End::Legal);
    }
    (flash, store)
}

#[test]
fn a_cut_at_any_write_leaves_the_record_before_or_this_one_or_says_that_nobody_knows() {
    let (mut random, mut unknown) = (seeded(51), 0);
    for round in 0..1_500u32 {
        let before = random.random_range(0..2 * RECORDS + 10);
        let (flash, mut store) = with_jobs(before, &mut random);
        let job = before + 1;
        flash.cut_after(random.random_range(0..2));
        store.note_begin(job, 0);
        let is_cut = flash.is_off();
        flash.power_up();
        let found = noted(&flash);
        unknown += u32::from(found.is_none());
        let at_rest = if before > 0 { record(before, Some(End::Legal)) } else { None };
        assert!(
            found.is_none() || found == record(job, None) || is_cut && found == at_rest,
            "{round}: {found:?}"
        );
        // And at its end.
        let mut store = Store::open(flash.clone());
        store.note_begin(job, 0);
        assert_eq!(noted(&flash), record(job, None), "{round}");
        let end = [End::Legal, End::Reset][random.random_range(0..2)];
        flash.cut_after(0);
        store.note_end(end);
        flash.power_up();
        let found = noted(&flash);
        assert!(found == record(job, None) || found == record(job, Some(end)), "{round}: {found:?}");
    }
    assert!(unknown > 100, "{unknown}");
}

#[test]
fn of_a_sheet_that_has_begun_no_bit_that_changes_makes_one_that_has_ended() {
    let mut random = seeded(52);
    let mut is_lost = 0;
    for _ in 0..40 {
        // The first record of a sector stands alone; the sector before may be erased or not.
        let before = [RECORDS, 2 * RECORDS, random.random_range(0..3 * RECORDS)][random.random_range(0..3)];
        let (flash, mut store) = with_jobs(before, &mut random);
        store.note_begin(before + 1, 0);
        for _ in 0..200 {
            let (byte, bit) = (random.random_range(0..DIARY * SECTOR), random.random_range(0..8));
            flash.flip(byte, bit);
            let found = noted(&flash);
            assert!(found.is_none_or(|found| found.end.is_none()), "byte {byte}, bit {bit}: {found:?}");
            is_lost += u32::from(found.is_none());
            flash.flip(byte, bit);
        }
    }
    assert!(is_lost > 10, "{is_lost}");
}

#[test]
fn an_erase_serves_128_jobs_and_stands_between_two() {
    let mut random = seeded(53);
    let (flash, mut store) = with_jobs(0, &mut random);
    store.make_room();
    let before: u32 = flash.erased()[..DIARY].iter().sum();
    for job in 1..=10 * RECORDS {
        let erased = flash.erased();
        let operations = flash.operations();
        store.note_begin(job, 0);
        store.note_begin(job, 0);
        store.note_end(End::Legal);
        store.note_end(End::Legal);
        assert_eq!((flash.erased(), flash.operations()), (erased, operations + 2), "job {job}");
        while store.make_room() {}
    }
    let erases = flash.erased()[..DIARY].iter().sum::<u32>() - before;
    assert!(erases <= 11, "{erases} erases");
}

#[test]
fn what_a_worn_flash_does_not_keep_is_not_taken_for_the_end_of_a_job() {
    let mut random = seeded(54);
    for _ in 0..60 {
        let before = random.random_range(0..2 * RECORDS);
        let (flash, mut store) = with_jobs(before, &mut random);
        flash.wear_out(random.random_range(0..DIARY * SECTOR));
        for job in before + 1..before + 4 {
            store.note_begin(job, 0);
            let found = noted(&flash);
            assert!(found.is_none_or(|found| found.end.is_none()), "{found:?} while job {job} is printed");
            store.note_end(End::Legal);
        }
    }
}

#[test]
fn random_bytes_say_nothing_and_the_next_record_stands_there_all_the_same() {
    for seed in 0..40 {
        let mut random = seeded(seed);
        let flash = ModelFlash::new(DIARY + 4, &mut random);
        assert_eq!(noted(&flash), None, "seed {seed}");
        let mut store = Store::open(flash.clone());
        if seed % 2 == 0 {
            store.make_room();
        }
        store.note_begin(7, 3);
        assert_eq!(noted(&flash), Some(Record { job: 7, stored: 3, end: None }));
    }
}

#[test]
fn the_lost_ones_among_the_last_jobs_are_known_at_the_next_start() {
    let mut random = seeded(55);
    for _ in 0..100 {
        let (flash, mut store) = with_jobs(random.random_range(0..2 * RECORDS), &mut random);
        let lost: Vec<bool> = (0..20).map(|_| random.random_bool(0.4)).collect();
        for (job, &lost) in (1_000..).zip(&lost) {
            store.note_begin(job, 0);
            match lost {
                // It ends by a reset, or the supply goes.
                true if random.random_bool(0.5) => store = Store::open(flash.clone()),
                true => store.note_end(End::Reset),
                false => store.note_end(End::Legal),
            }
        }
        // The last one is told by itself.
        let expected: Vec<u32> =
            (1_000..).zip(&lost).skip(11).take(8).filter(|(_, lost)| **lost).map(|(job, _)| job).collect();
        assert_eq!(Store::open(flash.clone()).lost_before().collect::<Vec<u32>>(), expected);
    }
}
