# Nix. Not tried.
{ pkgs ? import <nixpkgs> { } }:
pkgs.rustPlatform.buildRustPackage {
  pname = "foilpress";
  version = "0.1.0";
  src = ../..;
  cargoLock.lockFile = ../../Cargo.lock;
  cargoBuildFlags = [ "--package" "foilpress" "--all-features" ];
  doCheck = false; # `cargo xtask test` is the test
  postInstall = "install -Dm644 packaging/70-foilpress.rules $out/lib/udev/rules.d/70-foilpress.rules";
}
