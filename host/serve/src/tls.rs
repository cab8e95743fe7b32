//! Encryption: a certificate of the server's own.
//!
//! Problem: no authority signs for a printer at home, but clients that insist on encryption must be served, and those that remember a
//! certificate must find it again. Method: a key and a certificate that it signs itself, made at the first start and kept beside the
//! jobs; the same port answers both in the clear and encrypted, by the first byte of a connection, and changes over on request.
//! Limits: it protects from those who listen, not from one who stands between and whom the client has never met otherwise.
//! Source: RFC 8446; RFC 2817 for the change in the middle of a connection; RFC 8010, section 8.1.

use std::io;
use std::path::Path;
use std::sync::Arc;

use files::durable::{self, Access};
use rcgen::{CertificateParams, KeyPair};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};

/// The first byte of an encrypted connection: a handshake record.
pub const HANDSHAKE: u8 = 0x16;

fn other(error: impl std::fmt::Display) -> io::Error {
    io::Error::other(error.to_string())
}

/// The server's side of encrypted connections, with the certificate in a folder; made if there is none for these names.
///
/// # Errors
/// It cannot be kept, or what is kept is no certificate.
pub fn acceptor(folder: &Path, hosts: &[String]) -> io::Result<TlsAcceptor> {
    let (key, certificate) = (folder.join("key.pem"), folder.join("certificate.pem"));
    let mut names: Vec<String> = hosts.to_vec();
    names.extend(["localhost".into(), "127.0.0.1".into(), "::1".into()]);
    // The names stand before the certificate, where its readers do not look.
    let header = format!("Names: {}\n", names.join(" "));
    let read = || match (std::fs::read(&key), std::fs::read(&certificate)) {
        (Ok(key), Ok(certificate)) if certificate.starts_with(header.as_bytes()) => {
            config(&key, &certificate).ok()
        }
        _ => None,
    };
    let config = match read() {
        Some(config) => config,
        None => {
            let pair = KeyPair::generate().map_err(other)?;
            let made = CertificateParams::new(names).map_err(other)?.self_signed(&pair).map_err(other)?;
            let (key_text, text) = (pair.serialize_pem(), header + &made.pem());
            // The certificate last: one without its key is none.
            durable::write(&key, key_text.as_bytes(), Access::Private)?;
            durable::write(&certificate, text.as_bytes(), Access::Private)?;
            config(key_text.as_bytes(), text.as_bytes())?
        }
    };
    Ok(TlsAcceptor::from(Arc::new(config)))
}

fn config(key: &[u8], certificate: &[u8]) -> io::Result<ServerConfig> {
    let key = PrivateKeyDer::from_pem_slice(key).map_err(other)?;
    let chain = CertificateDer::pem_slice_iter(certificate).collect::<Result<Vec<_>, _>>().map_err(other)?;
    ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .map_err(other)?
        .with_no_client_auth()
        .with_single_cert(chain, key)
        .map_err(other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_certificate_is_made_once_and_made_again_if_it_is_damaged_or_of_other_names() {
        let folder = tempfile::tempdir().unwrap();
        let read = || std::fs::read(folder.path().join("certificate.pem")).unwrap();
        acceptor(folder.path(), &["workshop.local".into()]).unwrap();
        let first = read();
        acceptor(folder.path(), &["workshop.local".into()]).unwrap();
        assert_eq!(read(), first);
        std::fs::write(folder.path().join("key.pem"), "no key").unwrap();
        acceptor(folder.path(), &["workshop.local".into()]).unwrap();
        let second = read();
        assert_ne!(second, first);
        acceptor(folder.path(), &["workshop.local".into(), "printer.lan".into()]).unwrap();
        assert_ne!(read(), second);
    }
}
