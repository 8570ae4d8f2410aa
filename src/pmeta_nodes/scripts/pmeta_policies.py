"""Policies that a run left in policies/*.safetensors (format: pmeta_core/storage/policy_file.h)."""

import json
import os

import numpy as np

from pmeta_files import PlotError

DTYPES = {"F32": "<f4", "F64": "<f8", "U8": "u1"}


class Policy:
    """Metadata and tensors of one file."""

    def __init__(self, path, metadata, tensors):
        self.path = path
        self.metadata = metadata
        self.tensors = tensors

    def q_values(self, observations):
        """Batch x actions of a Q-network (pmeta_core/nn/mlp.h) for batch x observation size."""
        x = np.asarray(observations, dtype=np.float32)
        layers = sum(name.startswith("q.layer") and name.endswith(".weight")
                     for name in self.tensors)
        dueling = "q.value.weight" in self.tensors
        if not layers and not dueling:
            raise PlotError("%s holds no Q-network: its tensors are %s."
                            % (self.path, ", ".join(sorted(self.tensors)) or "none"))
        for i in range(layers):
            x = self._linear(x, "q.layer%d" % i)
            if dueling or i < layers - 1:
                x = np.maximum(x, 0)
        if dueling:
            advantage = self._linear(x, "q.advantage")
            x = self._linear(x, "q.value") + advantage - advantage.mean(axis=1, keepdims=True)
        return x

    def network(self, prefix, inputs):
        """Batch x outputs of a plain network, "actor" or its like, for batch x its inputs."""
        x = np.asarray(inputs, dtype=np.float32)
        layers = sum(name.startswith(prefix + ".layer") and name.endswith(".weight")
                     for name in self.tensors)
        if not layers:
            raise PlotError("%s holds no network '%s': its tensors are %s."
                            % (self.path, prefix, ", ".join(sorted(self.tensors)) or "none"))
        for i in range(layers):
            x = self._linear(x, "%s.layer%d" % (prefix, i), "network '%s'" % prefix)
            if i < layers - 1:
                x = np.maximum(x, 0)
        return x

    def inputs(self, prefix):
        """How many inputs that network has."""
        weight = self.tensors.get(prefix + ".layer0.weight")
        if weight is None or weight.ndim != 2:
            raise PlotError("%s holds no network '%s': %s.layer0.weight is missing or does not fit."
                            % (self.path, prefix, prefix))
        return weight.shape[1]

    def _linear(self, x, name, what="Q-network"):
        try:
            return x @ self.tensors[name + ".weight"].T + self.tensors[name + ".bias"]
        except (KeyError, ValueError):
            raise PlotError("%s holds no %s: %s is missing or does not fit." % (self.path, what,
                                                                              name))


def read_policy(path):
    with open(path, "rb") as file:
        data = file.read()
    length = int.from_bytes(data[:8], "little")
    try:
        if not 0 < length <= len(data) - 8:
            raise ValueError("it is cut off")
        header = json.loads(data[8:8 + length].decode("utf-8"))
        metadata = header.pop("__metadata__")
        tensors = {}
        for name, entry in header.items():
            begin, end = entry["data_offsets"]
            if not 0 <= begin <= end <= len(data) - 8 - length:
                raise ValueError("it is cut off")
            values = np.frombuffer(data[8 + length + begin:8 + length + end],
                                   dtype=DTYPES[entry["dtype"]])
            tensors[name] = values.reshape(entry["shape"])
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        why = str(error) if str(error) == "it is cut off" else "its header is malformed"
        raise PlotError("%s is not a policy file: %s." % (path, why))
    return Policy(path, metadata, tensors)


def policies_of(folder, tasks):
    """{"personal" and "meta": [the policy for each task]}, without what is not there."""
    files = {"personal": ["task_%d" % task for task in range(tasks)], "meta": ["meta"]}
    found = {}
    for name, stems in files.items():
        paths = [os.path.join(folder, "policies", stem + ".safetensors") for stem in stems]
        if all(os.path.isfile(path) for path in paths):
            found[name] = [read_policy(path) for path in paths] * (tasks // len(paths))
    return found
