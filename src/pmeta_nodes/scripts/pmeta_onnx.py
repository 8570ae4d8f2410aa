"""A policy's acting network as an ONNX graph: layers alone, all that is constant folded into them."""

import json
import re

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from pmeta_files import PlotError

OPSET = 10  # the last whose Clip has its bounds as attributes, which all readers know
ACTIVATIONS = {"relu": "Relu", "tanh": "Tanh"}
# what a runtime on a robot needs to know beside the graph
TOLD = ("environment", "learner", "policy", "task", "round", "run_id", "step_seconds",
        "observation", "action", "choices")


def model_of(policy, task=None):
    """The ONNX model of a Policy. `task`: of a meta-policy that is told its task, which one; without
    it, what tells the task is the model's second input. Throws PlotError."""
    network = Network(policy)
    if task is not None:
        network.fold_task(one_hot(policy, task, network.task_inputs))
    elif "task_input" in policy.metadata:
        network.fold_task([float(x) for x in policy.metadata["task_input"].split(",")])
    network.finish(policy)
    return checked(policy, graph_of(policy, network))


class Network:
    """Its layers, (weight [outputs, inputs], bias) in double precision, and what follows them."""

    def __init__(self, policy):
        form = policy.metadata
        prefix = form.get("network", "")
        if not prefix:
            raise PlotError(
                "%s has no network of layers that acts: a table, a recurrent policy or a file of an "
                "older version. policy_node drives it." % policy.path)
        self.activation = ACTIVATIONS.get(form.get("hidden_activation"))
        if self.activation is None or form.get("input_scaling") != "none":
            raise PlotError("%s has hidden layers or a scaling of inputs that the export does not know."
                            % policy.path)
        self.layers = []
        while "%s.layer%d.weight" % (prefix, len(self.layers)) in policy.tensors:
            self.layers.append(layer(policy, "%s.layer%d" % (prefix, len(self.layers))))
        if prefix + ".value.weight" in policy.tensors:
            self.layers.append(dueling(layer(policy, prefix + ".value"),
                                       layer(policy, prefix + ".advantage")))
        self.observations = int(form["observation_size"])
        self.task_inputs = self.layers[0][0].shape[1] - self.observations
        self.heads = int(form.get("heads", 1))
        self.after = []

    def fold_task(self, numbers):
        """What tells the task is the same in all inputs: a part of the first bias, and a choice of
        heads."""
        if len(numbers) != self.task_inputs:
            raise PlotError("the policy's network is told its task by %d numbers, not %d."
                            % (self.task_inputs, len(numbers)))
        weight, bias = self.layers[0]
        self.layers[0] = (weight[:, :self.observations],
                          bias + weight[:, self.observations:] @ np.array(numbers))
        if self.heads > 1:
            self.layers[-1] = tuple(np.tensordot(numbers, part.reshape(
                (self.heads, -1) + part.shape[1:]), 1) for part in self.layers[-1])
        self.task_inputs, self.heads = 0, 1

    def finish(self, policy):
        """The mean of a Gaussian alone, squashed and scaled as the environment takes it."""
        form = policy.metadata
        if self.heads > 1:
            raise PlotError("%s has last layers of its tasks' own: say which, by --task." % policy.path)
        self.discrete = int(form["num_actions"]) > 0
        if self.discrete:
            return
        count = len(json.loads(form["action"]))
        weight, bias = (part[:count] for part in self.layers[-1])
        scaling = re.fullmatch(r"(?:divided by (\S+), )?clipped to \[-1, 1\]", form["output_scaling"])
        if scaling:
            divisor = float(scaling.group(1) or 1)
            weight, bias = weight / divisor, bias / divisor
            self.after.append(("Clip", [], {"min": -1.0, "max": 1.0}))
        elif form["output_scaling"] != "none":
            raise PlotError("%s scales its actions in a way that the export does not know: %s."
                            % (policy.path, form["output_scaling"]))
        if form["output_squashing"] == "tanh":
            self.after.insert(0, ("Tanh", [], {}))
        self.layers[-1] = (weight, bias)


def layer(policy, name):
    try:
        return tuple(policy.tensors[name + part].astype(np.float64) for part in (".weight", ".bias"))
    except KeyError as missing:
        raise PlotError("%s lacks the tensor %s." % (policy.path, missing))


def dueling(value, advantage):
    """Q = V + A - mean A, of one linear layer."""
    return tuple(v + a - a.mean(axis=0, keepdims=True) for v, a in zip(value, advantage))


def one_hot(policy, task, size):
    if "task" in policy.metadata or "task_input" in policy.metadata or size == 0:
        raise PlotError("%s needs no --task: its file says what it acts on." % policy.path)
    if not 0 <= task < size:
        raise PlotError("--task is %d but must be one from 0 to %d." % (task, size - 1))
    return [float(i == task) for i in range(size)]


def graph_of(policy, network):
    constants, nodes = [], []

    def constant(name, values):
        constants.append(numpy_helper.from_array(np.asarray(values, np.float32), name))
        return name

    inputs = [helper.make_tensor_value_info("observation", TensorProto.FLOAT,
                                            ["batch", network.observations])]
    x = "observation"
    if network.task_inputs:
        inputs.append(helper.make_tensor_value_info("task_input", TensorProto.FLOAT,
                                                    ["batch", network.task_inputs]))
        nodes.append(helper.make_node("Concat", ["observation", "task_input"], ["input"], axis=1))
        x = "input"
    steps = []
    for k, (weight, bias) in enumerate(network.layers):
        if k > 0:
            steps.append((network.activation, [], {}))
        steps.append(("Gemm", [constant("weight%d" % k, weight), constant("bias%d" % k, bias)],
                      {"transB": 1}))
    steps += network.after
    last = "action_values" if network.discrete else "action"
    for k, (operation, more, attributes) in enumerate(steps):
        y = last if k + 1 == len(steps) else "x%d" % k
        nodes.append(helper.make_node(operation, [x] + more, [y], **attributes))
        x = y
    count = len(network.layers[-1][1])
    outputs = [helper.make_tensor_value_info(last, TensorProto.FLOAT, ["batch", count])]
    if network.discrete:
        nodes.append(helper.make_node("ArgMax", [last], ["action"], axis=1, keepdims=0))
        outputs.append(helper.make_tensor_value_info("action", TensorProto.INT64, ["batch"]))
    return helper.make_graph(nodes, "policy", inputs, outputs, constants)


def checked(policy, graph):
    model = helper.make_model(graph, producer_name="pMeta",
                              opset_imports=[helper.make_opsetid("", OPSET)])
    model.ir_version = 5  # of the opset: older readers refuse what is newer
    helper.set_model_props(model, {key: policy.metadata[key] for key in TOLD
                                   if key in policy.metadata})
    onnx.checker.check_model(model)
    return model
