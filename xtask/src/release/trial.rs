//! What each archive goes through before it counts: unpacked, it does what its users do first.
//!
//! Problem: a program that was built for another system has been run by nobody.
//! Method: the archive is unpacked as its users do and the program in it started, by itself, under `qemu` or under `wine`: a sample is printed, flat
//! art too, a plan is made, a job goes to a bridge on a socket, in a folder with a blank and a letter that is not ASCII in its name; one result has a
//! path of more than 260 letters; where Ghostscript is not, a PDF has to say how it is had. On Windows the job also goes through a COM port, and a
//! file is dropped on the program. What it has made comes back, to be compared.
//! Limits: no USB and no drivers, which an emulator of programs has not.

use std::fs;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use anyhow::{Context as _, Result, bail, ensure};

use super::{Form, System};
use crate::{command, succeed};

/// The head of the table of what was tried.
pub const HEAD: &str = "| system | program | archive | version, sample, layers, plan and sending | the same bytes as on amd64 |\n|---|---|---|---|---|\n";

/// A system's line in that table; sizes in bytes of program and archive.
pub fn line(system: &System, [program, archive]: [u64; 2], same: bool) -> String {
    let with = match system.form {
        Form::Zip => "wine; through a COM port and with a dropped file, too",
        _ => system.runner.map_or("by itself", |(runner, _)| runner[0]),
    };
    let alike = if same { "yes" } else { "other roundings, sizes within a hundredth" };
    let megabytes = |bytes| bytes as f64 / 1e6;
    format!(
        "| {} | {:.1} MB | {:.1} MB | {with} | {alike} |\n",
        system.name,
        megabytes(program),
        megabytes(archive)
    )
}

/// A small page in two inks and a tint.
const ART: &str = r##"<svg xmlns="http://www.w3.org/2000/svg" width="30mm" height="20mm" viewBox="0 0 30 20"><rect width="30" height="20" fill="#f0c080"/><circle cx="15" cy="10" r="6" fill="#204080"/></svg>"##;

/// An empty page, for a program without Ghostscript.
const PDF: &str = "%PDF-1.4\n1 0 obj<</Type/Catalog/Pages 2 0 R>>endobj\n2 0 obj<</Type/Pages/Kids[3 0 R]/Count 1>>endobj\n\
    3 0 obj<</Type/Page/Parent 2 0 R/MediaBox[0 0 200 200]>>endobj\ntrailer<</Root 1 0 R>>\n";

/// Windows' old limit of a path; that of the folder in which a program starts still holds.
const LONG: usize = 260;

/// Unpacks the archive in this folder, which is emptied, and uses its program; `bridge` serves a bridge on a socket. Gives two jobs and
/// a plan.
pub fn run(system: &System, archive: &Path, folder: &Path, bridge: &Path) -> Result<Vec<Vec<u8>>> {
    let _ = fs::remove_dir_all(folder);
    fs::create_dir_all(folder)?;
    let program = unpack(system, archive, folder)?;
    let work = folder.join("my prints é");
    if system.form == Form::Zip {
        random_numbers_for_wine(&program, folder)?;
    }
    fs::create_dir_all(&work)?;
    // Wine has a computer of its own, and no screen.
    let wine = folder.with_file_name("wine");
    let start = |arguments: &[&str]| {
        let mut run = match system.runner {
            Some(([runner, options @ ..], _)) => {
                let mut run = command(runner, options);
                run.arg(&program);
                run
            }
            _ => Command::new(&program),
        };
        run.env("WINEDEBUG", "-all").env("WINEPREFIX", &wine).env_remove("DISPLAY");
        run.args(arguments).current_dir(&work).stdin(Stdio::null());
        run.output().with_context(|| format!("cannot start {run:?}"))
    };
    let run = |arguments: &[&str]| {
        let output = start(arguments)?;
        if !output.status.success() {
            bail!("{} {arguments:?}: {}", system.name, String::from_utf8_lossy(&output.stderr));
        }
        Ok(output.stdout)
    };
    let version = run(&["--version"])?;
    ensure!(version.starts_with(b"foilpress "), "it said {}", String::from_utf8_lossy(&version));
    let above = format!("leaf é{}", "/a folder in a folder".repeat(LONG / 20));
    fs::create_dir_all(work.join(&above))?;
    let deep = format!("{above}/é");
    run(&["print", "sample:leaf", "--size", "20mm", "--to", "file:leaf.rgl", "-o", &deep])?;
    fs::write(work.join("art.svg"), ART)?;
    run(&["layers", "art.svg", "--to", "file:layers.rgl"])?;
    let plan = run(&["plan", "layers.rgl", "--json"])?;
    let read =
        |name: &str| fs::read(work.join(name)).with_context(|| format!("{} has made no {name}", system.name));
    ensure!(read(&format!("{deep}/job.rgl"))? == read("leaf.rgl")?, "the job in the folder is another");
    if system.form == Form::Zip {
        fs::write(work.join("page.pdf"), PDF)?;
        let said = start(&["layers", "page.pdf", "--to", "file:page.rgl"])?;
        let said = String::from_utf8_lossy(&said.stderr).into_owned();
        ensure!(said.contains("Ghostscript"), "without Ghostscript it said {said}");
        send(bridge, &work.join("layers.rgl"), |to| {
            through_com7(&wine, to, || run(&["send", "layers.rgl", "--to", "serial:COM7"]).map(drop))
        })?;
        dropped(&wine, &program, &work.join("art.svg"))?;
    }
    send(bridge, &work.join("layers.rgl"), |to| run(&["send", "layers.rgl", "--to", to]).map(drop))?;
    // Nobody listens there; the images are found and read before anything is asked.
    let flash = start(&["bridge", "flash", "--to", "tcp:127.0.0.1:1"])?;
    let flash = String::from_utf8_lossy(&flash.stderr).replace('\r', "");
    ensure!(
        flash.contains("for a Pico\n") && flash.contains("for a Pico 2\n"),
        "`bridge flash` said {flash}"
    );
    let made = vec![read("leaf.rgl")?, read("layers.rgl")?, plan];
    fs::remove_dir_all(folder)?;
    Ok(made)
}

/// The program in the archive, unpacked.
fn unpack(system: &System, archive: &Path, folder: &Path) -> Result<PathBuf> {
    let mut unpack = match system.form {
        Form::Deb(_) => command("dpkg-deb", &["--extract"]),
        Form::Tar => command("tar", &["--extract", "--file"]),
        Form::Zip => command("unzip", &["-q"]),
    };
    unpack.arg(archive).current_dir(folder);
    if matches!(system.form, Form::Deb(_)) {
        unpack.arg(folder);
    }
    succeed(&mut unpack)?;
    let program = match system.form {
        Form::Deb(_) => folder.join("usr/bin").join(system.program()),
        Form::Tar | Form::Zip => {
            let name = archive.file_name().and_then(|name| name.to_str()).context("a name")?;
            let name = name.trim_end_matches(".tar.gz").trim_end_matches(".zip");
            folder.join(name).join(system.program())
        }
    };
    ensure!(program.is_file(), "{} holds no program", archive.display());
    Ok(program)
}

/// Sends the job to a bridge on a socket and sees that the very bytes have crossed its port.
fn send(bridge: &Path, job: &Path, send: impl FnOnce(&str) -> Result<()>) -> Result<()> {
    let mut serving = Command::new(bridge).arg(job).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
    let mut address = String::new();
    if let Some(said) = serving.stdout.take() {
        BufReader::new(said).read_line(&mut address)?;
    }
    let sent = send(&format!("tcp:{}", address.trim()));
    // Its standard input is closed, and it judges.
    let right = serving.wait_with_output()?.status;
    sent?;
    ensure!(right.success(), "the bridge has not had the bytes of {}", job.display());
    Ok(())
}

/// Does this while Wine's COM7, which is a link to a terminal, leads to a socket.
fn through_com7(wine: &Path, to: &str, act: impl FnOnce() -> Result<()>) -> Result<()> {
    let port = wine.join("dosdevices").join("com7");
    let _ = fs::remove_file(&port);
    let terminal = format!("PTY,link={},raw,echo=0", port.display());
    let mut wire = command("socat", &[&terminal, &to.replacen("tcp", "TCP", 1)]).spawn()?;
    for _ in 0..100 {
        if port.exists() {
            break;
        }
        sleep(Duration::from_millis(50));
    }
    let done = act();
    // It has ended by itself if the bridge has hung up.
    let _ = wire.kill();
    wire.wait()?;
    done
}

/// Drops a file on the program: what it says has to stay until Enter is pressed.
fn dropped(wine: &Path, program: &Path, file: &Path) -> Result<()> {
    let line = format!("wine '{}' '{}'", program.display(), file.display());
    let mut window = command("script", &["-qec", &line, "/dev/null"])
        .env("WINEDEBUG", "-all")
        .env("WINEPREFIX", wine)
        .env_remove("DISPLAY")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    // Enter, again and again: what is typed before the window listens is lost.
    for _ in 0..60 {
        if window.try_wait()?.is_some() {
            break;
        }
        // It may close just now.
        let _ = window.stdin.iter_mut().try_for_each(|keys| keys.write_all(b"\r"));
        sleep(Duration::from_secs(1));
    }
    ensure!(window.try_wait()?.is_some(), "the window of a dropped file does not close");
    let drawn = window.wait_with_output()?.stdout;
    // Wine draws letter by letter, with movements of the cursor between them and for blanks.
    let drawn = String::from_utf8_lossy(&drawn);
    let letters = |part: &str| part.chars().filter(char::is_ascii_alphabetic).collect::<String>();
    let said: String = drawn
        .split('\x1b')
        .enumerate()
        .map(|(i, part)| {
            letters(if i == 0 {
                part
            } else {
                part.trim_start_matches(|c: char| !c.is_alphabetic()).get(1..).unwrap_or("")
            })
        })
        .collect();
    let expected = ["foilpress layers FILE", "Press Enter to close this window"].map(letters);
    ensure!(expected.iter().all(|words| said.contains(words)), "a dropped file was told {said}");
    Ok(())
}

/// Wine before version 9 lacks the library from which programs of Windows 10 have their random numbers: one that asks the older function lies
/// beside the program while it is tried.
fn random_numbers_for_wine(program: &Path, folder: &Path) -> Result<()> {
    const SOURCE: &str = "#include <windows.h>\n#include <ntsecapi.h>\n\
        __declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE data, SIZE_T length) { return RtlGenRandom(data, (ULONG)length); }\n";
    let source = folder.join("bcryptprimitives.c");
    fs::write(&source, SOURCE)?;
    let mut compile = command("x86_64-w64-mingw32-gcc", &["-shared", "-o"]);
    succeed(compile.arg(program.with_file_name("bcryptprimitives.dll")).arg(&source).arg("-ladvapi32"))
}
