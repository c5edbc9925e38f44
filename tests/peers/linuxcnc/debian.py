"""The programs that ship with LinuxCNC, from Debian's source package."""

import subprocess
import tarfile
import tempfile
from pathlib import Path

SOURCES = Path("/etc/apt/sources.list.d/debian.sources")
FOLDERS = ("nc_files", "tests/trajectory-planner")


def folders(cache):
    """The folders of programs in `cache`. The first time they are downloaded."""
    if not all((cache / name).is_dir() for name in FOLDERS):
        cache.mkdir(parents=True, exist_ok=True)
        unpack(downloaded(cache), cache)
    return [cache / name for name in FOLDERS]


def downloaded(cache):
    """The source archive. Lists of sources are read for this alone; those of the system stay."""
    with tempfile.TemporaryDirectory() as folder:
        # `apt-get update` clears the folder of lists of everything else.
        lists, sources = Path(folder, "lists"), Path(folder, "source.sources")
        (lists / "partial").mkdir(parents=True)
        sources.write_text(SOURCES.read_text().replace("Types: deb\n", "Types: deb-src\n"))
        command = ["apt-get", "-qq", "-o", f"Dir::Etc::SourceList={sources}", "-o", "Dir::Etc::SourceParts=/dev/null",
                   "-o", f"Dir::State::Lists={lists}", "-o", "APT::Sandbox::User=root"]
        subprocess.run([*command, "update"], check=True)
        subprocess.run([*command, "source", "--download-only", "linuxcnc"], check=True, cwd=cache)
    return next(cache.glob("linuxcnc_*.orig.tar.*"))


def unpack(archive, cache):
    """Unpacks the programs; the archive has one folder around all."""
    with tarfile.open(archive) as files:
        for member in files:
            name = member.name.partition("/")[2]
            if name.startswith(tuple(folder + "/" for folder in FOLDERS)) and member.isfile():
                path = cache / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(files.extractfile(member).read())
