//! Archives of libraries: what goes in comes out, as another reader of archives sees it, too; what strangers make is refused.

use std::fs;
use std::io::{Cursor, Write as _};
use std::path::Path;
use std::process::Command;

use files::shelf::Disk;
use inks::archive::{Member, PROVENANCE, gather, pack, place, unpack};
use inks::{Library, Stack};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

const LIBRARY: &str = "format = 1\nbased_on = \"built-in\"\nname = \"mine\"\n[[measured]]\nstack = \"MS+C\"\n\
    curve = \"curves/ms-c.csv\"\nby = \"A. Owner\"\nwhen = \"2026-11-02\"\nsetup = \"a can\"\n";
const CURVE: &str = "theta_h_deg,r,g,b\n0,0.1,0.2,0.3\n10,0.05,0.1,0.2\n60,0.01,0.02,0.03\n";

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("curves")).unwrap();
    fs::write(folder.path().join("library.toml"), LIBRARY).unwrap();
    fs::write(folder.path().join("curves/ms-c.csv"), CURVE).unwrap();
    fs::write(folder.path().join("thesis.txt"), "no part of it").unwrap();
    folder
}

fn packed(folder: &Path) -> Vec<u8> {
    let library = Library::open(&Disk, folder).unwrap();
    pack(&gather(&Disk, folder).unwrap(), &library, Some("CC0-1.0")).unwrap()
}

#[test]
fn what_was_packed_comes_out() {
    let from = folder();
    let archive = packed(from.path());
    assert_eq!(archive, packed(from.path()), "equal libraries give equal archives");
    let to = tempfile::tempdir().unwrap();
    let members = unpack(&archive).unwrap();
    place(&members, to.path()).unwrap();
    let mut library = Library::open(&Disk, to.path()).unwrap();
    assert_eq!(library.licence(), Some("CC0-1.0"));
    let stack: Stack = "MS+C".parse().unwrap();
    assert_eq!(library.entry(&stack), Library::open(&Disk, from.path()).unwrap().entry(&stack));
    assert!(!to.path().join("thesis.txt").exists());
    // What was imported can be exported, with the licence it has and no other.
    let again = gather(&Disk, to.path()).unwrap();
    assert!(pack(&again, &library, None).is_ok());
    assert!(pack(&again, &library, Some("MIT")).unwrap_err().to_string().contains("not MIT"));
    library = Library::open(&Disk, from.path()).unwrap();
    let error = pack(&gather(&Disk, from.path()).unwrap(), &library, None).unwrap_err().to_string();
    assert!(error.contains("no licence"), "{error}");
    assert!(place(&members, to.path()).is_err(), "nothing is overwritten");
}

/// Python's own reader of archives finds the same files, undamaged, with the hashes that the provenance lists.
#[test]
fn another_reader_sees_the_same_files() {
    let from = folder();
    let path = from.path().join("mine.zip");
    fs::write(&path, packed(from.path())).unwrap();
    let script = "import sys, zipfile, json, hashlib\n\
        z = zipfile.ZipFile(sys.argv[1])\n\
        assert z.testzip() is None\n\
        p = json.loads(z.read('provenance.json'))\n\
        assert p['licence'] == 'CC0-1.0' and p['curves'][0]['by'] == 'A. Owner', p\n\
        assert {f['name'] for f in p['files']} | {'provenance.json'} == set(z.namelist())\n\
        assert all(hashlib.sha256(z.read(f['name'])).hexdigest() == f['sha256'] for f in p['files'])\n\
        print(z.read('curves/ms-c.csv').decode(), end='')\n";
    let Ok(output) = Command::new("python3").args(["-c", script]).arg(&path).output() else {
        eprintln!("skipped: needs python3");
        return;
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stdout), CURVE);
}

/// An archive of these files as any program could make it, with a provenance that agrees with them.
fn forged(files: &[(&str, &[u8])]) -> Vec<u8> {
    let members: Vec<Member> =
        files.iter().map(|(name, bytes)| Member { name: (*name).into(), bytes: bytes.to_vec() }).collect();
    let from = folder();
    // The provenance of the honest library, with the list of these files.
    let honest = unpack(&packed(from.path())).unwrap();
    let provenance = honest.iter().find(|member| member.name == PROVENANCE).unwrap();
    let mut json: serde_json::Value = serde_json::from_slice(&provenance.bytes).unwrap();
    let hash = |bytes: &[u8]| {
        use sha2::Digest as _;
        sha2::Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect::<String>()
    };
    let listed =
        members.iter().map(|m| serde_json::json!({"name": m.name, "bytes": 0, "sha256": hash(&m.bytes)}));
    json["files"] = listed.collect();
    let json = serde_json::to_vec(&json).unwrap();
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    for (name, bytes) in files.iter().copied().chain([(PROVENANCE, json.as_slice())]) {
        writer.start_file(name, options).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

fn refused(archive: &[u8]) -> String {
    unpack(archive).unwrap_err().to_string()
}

#[test]
fn names_cannot_lead_out_of_the_folder() {
    let library = LIBRARY.as_bytes();
    assert!(unpack(&forged(&[("library.toml", library), ("curves/ms-c.csv", b"x")])).is_ok());
    for name in [
        "../ms-c.csv",
        "/etc/ms-c.csv",
        "a/../../b.csv",
        "C:\\b.csv",
        "C:b.csv",
        "a\\..\\..\\b.csv",
        ".ssh/b.csv",
        "a//b.csv",
        "./b.csv",
        "con.csv",
        "a/LPT1.csv",
        "b.csv.",
        "b.csv ",
        "-b.csv",
        "a/b/c/d/e.csv",
        "\u{1b}[2J.csv",
        "\u{202e}vsc.csv",
        "b\0.csv",
    ] {
        let said = refused(&forged(&[("library.toml", library), (name, b"x")]));
        assert!(said.contains("plain name") && !said.contains('\u{1b}'), "{name}: {said}");
    }
    let said = refused(&forged(&[("library.toml", library), ("run.exe", b"x")]));
    assert!(said.contains("run.exe: is no part of a library"), "{said}");
    let said = refused(&forged(&[("library.toml", library), ("A.csv", b"x"), ("a.csv", b"x")]));
    assert!(said.contains("twice"), "{said}");
}

#[test]
fn links_and_folders_are_refused() {
    let honest = forged(&[("library.toml", LIBRARY.as_bytes()), ("a.csv", b"/etc/passwd")]);
    for mode in [0o120_777_u32, 0o040_755, 0o060_644, 0o010_644] {
        // External attributes hold the mode in their upper half, 38 bytes into the record of the central directory.
        let mut archive = honest.clone();
        let record = central(&archive, "a.csv");
        archive[record + 5] = 3;
        archive[record + 38..record + 42].copy_from_slice(&(mode << 16).to_le_bytes());
        let said = refused(&archive);
        assert!(said.contains("plain files only"), "{mode:o}: {said}");
    }
}

/// Where the record of this file begins in the central directory.
fn central(archive: &[u8], name: &str) -> usize {
    let mut found = (0..archive.len() - 46).filter(|&at| {
        archive[at..].starts_with(b"PK\x01\x02") && archive[at + 46..].starts_with(name.as_bytes())
    });
    found.next().unwrap()
}

#[test]
fn two_files_of_one_name_are_refused() {
    let mut archive = forged(&[("library.toml", LIBRARY.as_bytes()), ("a.csv", b"x"), ("b.csv", b"y")]);
    let at: Vec<usize> = (0..archive.len()).filter(|&at| archive[at..].starts_with(b"b.csv")).collect();
    for at in at {
        archive[at] = b'a';
    }
    let said = refused(&archive);
    assert!(said.contains("two files of one name"), "{said}");
}

#[test]
fn bombs_are_refused_before_they_burst() {
    // 17 MB of zeros in some kilobytes.
    let zeros = vec![0u8; 17 << 20];
    let archive = forged(&[("library.toml", LIBRARY.as_bytes()), ("a.csv", &zeros)]);
    assert!(archive.len() < 100_000);
    let said = refused(&archive);
    assert!(said.contains("a.csv: holds more than"), "{said}");
    // The same with a size that lies.
    let mut lying = archive.clone();
    let record = central(&lying, "a.csv");
    lying[record + 24..record + 28].copy_from_slice(&10u32.to_le_bytes());
    let said = refused(&lying);
    assert!(said.contains("a.csv"), "{said}");
    // Nine files of 16 MB each are too much together.
    let names: Vec<String> = (0..9).map(|i| format!("{i}.csv")).collect();
    let big = &zeros[..16 << 20];
    let files = names.iter().map(|name| (name.as_str(), big));
    let said = refused(&forged(&files.chain([("library.toml", LIBRARY.as_bytes())]).collect::<Vec<_>>()));
    assert!(said.contains(".csv: holds more than"), "{said}");
    // Two entries that share their bytes.
    let mut shared = forged(&[("library.toml", LIBRARY.as_bytes()), ("a.csv", b"xyz"), ("b.csv", b"xyz")]);
    let (a, b) = (central(&shared, "a.csv"), central(&shared, "b.csv"));
    let offset: Vec<u8> = shared[a + 42..a + 46].to_vec();
    shared[b + 42..b + 46].copy_from_slice(&offset);
    let said = refused(&shared);
    assert!(said.contains("share their bytes"), "{said}");
    let many: Vec<String> = (0..300).map(|i| format!("{i}.csv")).collect();
    let said = refused(&forged(&many.iter().map(|name| (name.as_str(), &b"x"[..])).collect::<Vec<_>>()));
    assert!(said.contains("301 files"), "{said}");
}

#[test]
fn what_the_provenance_does_not_list_is_refused() {
    let from = folder();
    let library = Library::open(&Disk, from.path()).unwrap();
    let members = gather(&Disk, from.path()).unwrap();
    let archive = pack(&members, &library, Some("CC0-1.0")).unwrap();
    let mut changed = unpack(&archive).unwrap();
    let again = |members: &[Member]| {
        let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
        for member in members {
            writer.start_file(member.name.as_str(), SimpleFileOptions::default()).unwrap();
            writer.write_all(&member.bytes).unwrap();
        }
        writer.finish().unwrap().into_inner()
    };
    assert!(unpack(&again(&changed)).is_ok());
    changed[1].bytes[20] ^= 1;
    assert!(refused(&again(&changed)).contains("ms-c.csv: is not the file"));
    assert!(refused(&again(&changed[..1])).contains(PROVENANCE));
    changed[1].bytes[20] ^= 1;
    changed.push(Member { name: "more.csv".into(), bytes: Vec::new() });
    assert!(refused(&again(&changed)).contains("other files"));
}

/// Cut short or with one byte changed anywhere: an error or the same files, never a panic.
#[test]
fn damage_is_found() {
    let from = folder();
    let archive = packed(from.path());
    let whole = unpack(&archive).unwrap();
    for length in 0..archive.len() {
        assert!(unpack(&archive[..length]).is_err(), "{length}");
    }
    for at in 0..archive.len() {
        let mut damaged = archive.clone();
        damaged[at] ^= 0x41;
        if let Ok(members) = unpack(&damaged) {
            let files = |members: &[Member]| {
                let mut files: Vec<_> = members.iter().map(|m| (m.name.clone(), m.bytes.clone())).collect();
                files.sort();
                files
            };
            assert_eq!(files(&members), files(&whole), "{at}");
        }
    }
}
