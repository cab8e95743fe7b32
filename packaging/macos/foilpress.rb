# Homebrew formula from source. Not tried: nobody of us has a Mac. `url` and `sha256` are of a release's source archive.
class Foilpress < Formula
  desc "Print materials instead of colours on the ALPS MD-5500"
  homepage "https://example.org/foilpress"
  url "https://example.org/foilpress-0.1.0.tar.gz"
  version "0.1.0"
  license any_of: ["MIT", "Apache-2.0"]

  depends_on "rust" => :build
  depends_on "ghostscript"

  def install
    system "cargo", "install", "--locked", "--path", "host", "--all-features", "--root", prefix
    generate = buildpath/"tree"
    system bin/"foilpress", "generate", generate
    man1.install Dir[generate/"usr/share/man/man1/*"]
  end

  test do
    system bin/"foilpress", "print", "sample:leaf", "--size", "20mm", "--to", "file:leaf.rgl"
    assert_predicate testpath/"leaf.rgl", :exist?
  end
end
