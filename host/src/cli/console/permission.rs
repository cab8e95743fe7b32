//! Permission to open a bridge: whether an error is about it, and how to give it.

use std::io;

use device::connection::OpenError;
use device::connection::usb::UDEV_RULES;
use device::deliver::Failure;
use device::flash::FlashError;

/// Whether the operating system refused an access that a rule would allow.
pub fn is_missing(error: &anyhow::Error) -> bool {
    let refused = |open: &OpenError| matches!(open, OpenError::Forbidden(_));
    error.chain().any(|cause| {
        cause.downcast_ref().is_some_and(refused)
            || match cause.downcast_ref() {
                Some(Failure::Open(open)) => refused(open),
                _ => false,
            }
            || match cause.downcast_ref() {
                Some(FlashError::Open(open)) => refused(open),
                Some(FlashError::Closed(error)) => error.kind() == io::ErrorKind::PermissionDenied,
                _ => false,
            }
    })
}

/// What the user has to do to give the permission.
pub fn how_to_give() -> String {
    if !cfg!(target_os = "linux") {
        return "Close other programs that may use the bridge, then unplug it and plug it in again.\n".into();
    }
    let rules: String = UDEV_RULES.lines().filter(|line| !line.starts_with('#') && !line.is_empty()).fold(
        String::new(),
        |mut rules, line| {
            rules += line;
            rules.push('\n');
            rules
        },
    );
    format!(
        "Give permission once with these commands, then unplug the bridge and plug it in again:\n\n\
         sudo tee /etc/udev/rules.d/70-foilpress.rules <<'END'\n{rules}END\n\
         sudo udevadm control --reload && sudo udevadm trigger\n"
    )
}
