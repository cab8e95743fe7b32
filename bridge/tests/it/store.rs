//! The store on flash whose supply goes anywhere: what was there before, or what is new, and nothing between.

use bridge::store::{Next, PAGE_DATA, SECTOR, Store, Worn};
use model::flash::ModelFlash;
use model::seeded;
use proptest::prelude::*;
use protocol::link::message::JobKind;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

type Kept = Vec<(u32, JobKind, String, Vec<u8>)>;

/// Stores a job as far as the supply lasts; whether it counts then.
fn put(
    store: &mut Store<ModelFlash>,
    job: u32,
    kind: JobKind,
    name: &str,
    data: &[u8],
) -> Result<bool, Worn> {
    if !store.begin(job, kind, data.len() as u32, name) {
        return Ok(false);
    }
    let mut left = data;
    loop {
        let (page, rest) = left.split_at(store.wants());
        if store.put(page)? {
            assert!(rest.is_empty());
            return Ok(true);
        }
        left = rest;
    }
}

/// Everything that is in a store.
fn all(store: &Store<ModelFlash>) -> Kept {
    store
        .jobs()
        .iter()
        .map(|stored| {
            let (mut reading, mut data, mut page) = (store.read(stored), Vec::new(), [0; PAGE_DATA]);
            loop {
                match store.next(&mut reading, &mut page) {
                    Next::Bytes(count) => data.extend_from_slice(&page[..count]),
                    Next::Later => {}
                    Next::Damaged => panic!("job {} is damaged behind {} bytes", stored.job, data.len()),
                    Next::End => break,
                }
            }
            (stored.job, stored.kind, store.name(stored).to_string(), data)
        })
        .collect()
}

fn some_job(job: u32, room: u32, random: &mut ChaCha8Rng) -> (u32, JobKind, String, Vec<u8>) {
    let most = [room, room.min(30_000), room.min(600), room.min(600)][random.random_range(0..4)];
    let kind = if random.random_bool(0.5) { JobKind::Raw } else { JobKind::Streams };
    let mut data = vec![0; random.random_range(1..=most.max(1)) as usize];
    data.fill_with(|| random.random());
    (job, kind, format!("job {job}"), data)
}

#[test]
fn a_thousand_cuts_of_the_supply_leave_the_old_or_the_new_state() {
    let mut random = seeded(11);
    let (mut cuts, mut whole, mut half, mut gone, mut left) = (0, 0, 0, 0, 0);
    while cuts < 1000 {
        let flash = ModelFlash::new(random.random_range(4..24), &mut random);
        let (mut expected, mut number) = (Kept::new(), 0);
        for _ in 0..20 {
            let mut store = Store::open(flash.clone());
            assert_eq!(all(&store), expected);
            if random.random_bool(0.8) {
                let most = if random.random_bool(0.5) { 12 } else { 120 };
                flash.cut_after(random.random_range(0..most));
            }
            while !flash.is_off() {
                number += 1;
                if !expected.is_empty() && random.random_bool(0.4) {
                    let which = random.random_range(0..expected.len());
                    let before = expected.clone();
                    let job = expected.remove(which).0;
                    assert!(store.delete(job));
                    if flash.is_off() {
                        flash.power_up();
                        let found = all(&Store::open(flash.clone()));
                        (gone, left) =
                            (gone + usize::from(found == expected), left + usize::from(found == before));
                        assert!(found == expected || found == before, "the job is there, or it is not");
                        (expected, cuts) = (found, cuts + 1);
                        break;
                    }
                } else {
                    let room = store.room();
                    let (job, kind, name, data) = some_job(number, room, &mut random);
                    let counts = put(&mut store, job, kind, &name, &data);
                    let before = expected.clone();
                    if room > 0 {
                        expected.push((job, kind, name, data));
                    }
                    if flash.is_off() {
                        flash.power_up();
                        let found = all(&Store::open(flash.clone()));
                        (whole, half) =
                            (whole + usize::from(found == expected), half + usize::from(found == before));
                        assert!(
                            found == expected || found == before,
                            "the job is there as a whole, or not at all"
                        );
                        (expected, cuts) = (found, cuts + 1);
                        break;
                    }
                    assert_eq!(counts, Ok(room > 0));
                }
                assert_eq!(all(&store), expected);
                if number % 7 == 0 {
                    break;
                }
            }
        }
    }
    assert!(whole > 8 && half > 300 && gone > 20 && left > 8, "{whole} {half} {gone} {left}");
}

#[test]
fn every_sector_is_erased_as_often_as_the_others() {
    let mut random = seeded(13);
    let flash = ModelFlash::new(34, &mut random);
    let mut store = Store::open(flash.clone());
    // One job stays where it is, the others come and go.
    let fixed = some_job(1, 20_000, &mut random);
    assert_eq!(put(&mut store, 1, fixed.1, &fixed.2, &fixed.3), Ok(true));
    let before = flash.erased();
    for job in 2..600 {
        let (_, kind, name, data) = some_job(job, 30_000, &mut random);
        assert_eq!(put(&mut store, job, kind, &name, &data), Ok(true));
        if job % 3 == 0 {
            // Across starts, too.
            store = Store::open(flash.clone());
        }
        assert!(store.delete(job));
    }
    assert_eq!(all(&store), [fixed]);
    let erased: Vec<u32> =
        flash.erased().iter().zip(before).map(|(now, before)| now - before).skip(2).collect();
    let used: Vec<u32> = erased.iter().copied().filter(|&count| count > 0).collect();
    let (least, most) = (used.iter().min().unwrap(), used.iter().max().unwrap());
    assert!(*least > 50 && most - least <= 2, "{erased:?}");
}

proptest! {
    #![proptest_config(testing::cases(48))]
    #[test]
    fn room_is_what_fits_to_the_byte(sectors in 1usize..12, seed in any::<u64>(), jobs in 0u32..5) {
        let mut random = seeded(seed);
        let flash = ModelFlash::new(sectors, &mut random);
        let mut store = Store::open(flash.clone());
        prop_assert_eq!(store.room(), store.total());
        prop_assert_eq!(store.total(), match sectors { 1 | 2 => 0, many => 14 * 252 + (many as u32 - 3) * 15 * 252 });
        for job in 1..=jobs {
            let (_, kind, name, data) = some_job(job, store.room(), &mut random);
            let fits = store.room() > 0;
            prop_assert_eq!(put(&mut store, job, kind, &name, &data), Ok(fits));
        }
        let room = store.room();
        let data: Vec<u8> = (0..=room).map(|_| random.random()).collect();
        prop_assert!(!store.begin(77, JobKind::Raw, room + 1, "too much"));
        if room > 0 {
            prop_assert_eq!(put(&mut store, 77, JobKind::Raw, "all", &data[..room as usize]), Ok(true));
            prop_assert_eq!(store.room(), 0);
            let kept = all(&Store::open(flash));
            prop_assert_eq!(&kept.last().unwrap().3[..], &data[..room as usize]);
        }
    }

    /// Whatever is in the flash, the store opens, and says of each page whether it is what was written.
    #[test]
    fn a_flipped_bit_is_noticed(seed in any::<u64>(), bit in 0u8..8) {
        let mut random = seeded(seed);
        let flash = ModelFlash::new(12, &mut random);
        let mut store = Store::open(flash.clone());
        let (_, kind, name, data) = some_job(5, store.room(), &mut random);
        prop_assert_eq!(put(&mut store, 5, kind, &name, &data), Ok(true));
        flash.flip(random.random_range(2 * SECTOR as usize..12 * SECTOR as usize), bit);
        let store = Store::open(flash);
        if let Some(stored) = store.jobs().first() {
            let (mut reading, mut read, mut page) = (store.read(stored), Vec::new(), [0; PAGE_DATA]);
            for _ in 0..1000 {
                match store.next(&mut reading, &mut page) {
                    Next::Bytes(count) => read.extend_from_slice(&page[..count]),
                    Next::Later => {}
                    Next::Damaged => break,
                    Next::End => break,
                }
            }
            prop_assert!(data.starts_with(&read));
        }
    }
}

#[test]
fn flash_that_is_worn_out_is_noticed_and_leaves_what_was_there() {
    let mut random = seeded(14);
    for worn in (2 * SECTOR as usize..9 * SECTOR as usize).step_by(777) {
        let flash = ModelFlash::new(9, &mut random);
        let mut store = Store::open(flash.clone());
        assert_eq!(put(&mut store, 1, JobKind::Raw, "small", &[7; 100]), Ok(true));
        flash.wear_out(worn.max(3 * SECTOR as usize));
        let data: Vec<u8> = (0..store.room()).map(|_| random.random()).collect();
        assert_eq!(put(&mut store, 2, JobKind::Raw, "large", &data), Err(Worn));
        assert_eq!(all(&store).len(), 1);
        assert_eq!(all(&Store::open(flash)).len(), 1);
    }
}

#[test]
fn a_long_name_is_cut_between_letters() {
    let mut store = Store::open(ModelFlash::new(4, &mut seeded(1)));
    let name = "ä".repeat(30);
    assert_eq!(put(&mut store, 1, JobKind::Raw, &name, &[1]), Ok(true));
    assert_eq!(store.name(&store.jobs()[0]), *"ä".repeat(18));
}

#[test]
fn a_board_without_an_area_has_no_room() {
    let mut store = Store::open(bridge::store::NoFlash);
    assert_eq!((store.room(), store.total()), (0, 0));
    assert!(!store.begin(1, JobKind::Raw, 1, "x"));
}
