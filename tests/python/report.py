"""The JSON report's schema, as the tests understand it: the one place to change when it moves."""
import json
import pathlib


class Report:
    def __init__(self, path):
        self.path = pathlib.Path(path)
        self.data = json.loads(self.path.read_text())

    # What was found.
    def became(self, what):
        """Names of the nodes that became `what`: region, surface, sun, camera or ignored."""
        return sorted(entry["node"] for entry in self.data["found"] if entry["became"] == what)

    def why(self, node):
        return " ".join(entry["why"] or "" for entry in self.data["found"] if entry["node"] == node)

    @property
    def notes(self):
        return [note if isinstance(note, str) else json.dumps(note) for note in self.data["notes"]]

    # Regions and their optical mass, sigma_t times volume, m^2.
    @property
    def regions_source(self):
        return self.data["regions"]["source"]

    @property
    def regions_synthesised(self):
        return self.data["regions"]["synthesised"]

    @property
    def mass_source(self):
        return self.data["optical_mass"]["source"]

    @property
    def mass_written(self):
        return self.data["optical_mass"]["written"]

    @property
    def mass_missing(self):
        return self.data["optical_mass"]["missing"]

    # Photons.
    @property
    def photons_emitted(self):
        return self.data["photons"]["emitted"]

    @property
    def photons_stored(self):
        return self.data["photons"]["stored"]

    # The grid.
    @property
    def density_scale(self):
        """sigma_t in 1/m of a voxel whose density is 1."""
        return self.data["vdb"]["density_scale"]

    @property
    def voxel_size(self):
        return self.data["vdb"]["voxel_size"]


# Fields that may differ between two runs of the same job: clocks, the machine and where the files lie.
UNSTABLE = {"seconds", "timings", "elapsed", "wall_seconds", "cpu_seconds", "peak_memory", "peak_memory_bytes", "memory",
            "threads", "date", "time", "host", "outputs", "written_files", "command", "rate", "photons_per_second", "samples_per_second", "seconds_for_half", "forecast", "stages"}


def stable(value):
    """The report without what may differ from run to run."""
    if isinstance(value, dict):
        return {k: stable(v) for k, v in value.items() if k not in UNSTABLE and not k.endswith(("_seconds", "_bytes"))}
    if isinstance(value, list):
        return [stable(v) for v in value]
    return value


def effects(plan):
    """`plan --json`: the effects, as {name: (on, reason, figure)}."""
    entries = plan["effects"]
    if isinstance(entries, dict):
        entries = [dict(entry, name=name) for name, entry in entries.items()]
    out = {}
    for entry in entries:
        name = entry.get("name") or entry["effect"]
        assert isinstance(entry["on"], bool), entry
        out[name] = (entry["on"], entry["reason"], entry["figure"])
    return out
