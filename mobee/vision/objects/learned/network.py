# SPDX-License-Identifier: Apache-2.0
"""The network of a learned detector: three convolutions, stored as ONNX with the kinds of objects it was trained for, and run by OpenCV.

The first convolution has two inputs around each pixel: 5 x 5 adjacent pixels, which show the edge, and 5 x 5 pixels with a spacing of
`APART` (5 pixels), which show the surroundings. The other two convolutions combine the results within each pixel.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mobee.errors import InvalidValue, NotInstalled
from mobee.rendering.camera import Floats
from mobee.rendering.scene import Picture
from mobee.robot.writing import write_whole
from mobee.vision.objects.thing import KINDS, Thing
from mobee.vision.regions import checked_picture

FORMAT = "mobee detector 1"
KEY = "mobee"  # of the metadata
SUFFIX = ".onnx"
SIDE, APART = 5, 5  # pixels
MIDDLE = 127.5  # of 255: the brightness that is 0 for the network, and that of what is beyond the border
OPSET, IR = 13, 8  # of ONNX
TRAIN = "mobee detector train"

Layer = tuple[Floats, Floats]  # weights (inputs, outputs), bias (outputs,)
Shares = Callable[[Picture], Floats]
"""A function that takes a picture (H, W, 3) and returns the share of each of N things in each pixel, (N, H, W), 0 to 1."""


@dataclass(frozen=True, slots=True)
class Network:
    """A trained network.

    `things`: the kinds of objects for which it was trained, in the order of its outputs. `model`: the network as the bytes of an ONNX file.
    """

    things: tuple[Thing, ...]
    model: bytes

    def save(self, path: Path) -> Path:
        """Write the network to a file, completely or not at all, and return the path; raise OSError if the file cannot be written."""
        return write_whole(path, self.model)

    def require(self, things: Sequence[Thing], path: str) -> None:
        """Raise InvalidValue unless the network was trained for exactly these things: names, kinds, sizes and colours.

        `path`: the file of the network, for the message.
        """
        own, given = {_looks(one) for one in self.things}, {_looks(one) for one in things}
        if own != given:
            trained, asked = ("; ".join(sorted(_text(one) for one in some)) for some in (own - given, given - own))
            raise InvalidValue(
                f"{path}: trained for other things than those of this world. Only the file has: {trained or 'none'}. Only the world has: "
                f"{asked or 'none'}. Train a detector for this world: {TRAIN} FILE --world WORLD"
            )

    def shares(self) -> Shares:
        """Return a function that runs the network: it takes a picture (H, W, 3) and returns an array (N, H, W).

        An element of the array is the share of a pixel, 0 to 1, that one of the N things covers.

        Raises InvalidValue if OpenCV cannot read the network, and NotInstalled without OpenCV. The function raises InvalidValue if OpenCV
        cannot run the network.
        """
        cv2 = _imported("cv2")
        try:
            net = cv2.dnn.readNetFromONNX(np.frombuffer(self.model, np.uint8))
        except cv2.error as error:
            raise InvalidValue(f"OpenCV cannot read the network: {error.err}") from None

        def run(picture: Picture) -> Floats:
            net.setInput(checked_picture(picture).transpose(2, 0, 1)[None] / np.float32(MIDDLE) - np.float32(1.0))
            try:
                found: Floats = np.clip(net.forward()[0], 0.0, 1.0)
            except cv2.error as error:
                raise InvalidValue(f"OpenCV cannot run the network: {error.err}") from None
            return found

        return run


def network_of(things: Sequence[Thing], first: Layer, second: Layer, third: Layer) -> Network:
    """Return the network with these three layers; a layer is a pair of weights (inputs, outputs) and bias (outputs,).

    `things`: the kinds of objects for which it was trained. The third layer has one output for each of them, in this order.

    The 150 inputs of the first layer are a flattened array (2, 3, 5, 5). Its axes are: the set of pixels (0: near, 1: far), colour (red,
    green, blue), row and column. The near pixels are 5 x 5 adjacent ones, the far ones 5 x 5 with a spacing of 5 pixels. Raises
    NotInstalled without ONNX.
    """
    onnx = _imported("onnx")
    helper, arrays = onnx.helper, onnx.numpy_helper
    near, far = first[0].T.reshape(-1, 2, 3, SIDE, SIDE).transpose(1, 0, 2, 3, 4)
    weights = {"near": near, "far": far, "first": first[1]}
    weights |= {
        "second": second[0].T[..., None, None],
        "second_bias": second[1],
        "third": third[0].T[..., None, None],
        "third_bias": third[1],
    }
    half = SIDE // 2
    nodes = [
        helper.make_node("Conv", ["picture", "near", "first"], ["edge"], kernel_shape=[SIDE, SIDE], pads=[half] * 4),
        helper.make_node("Conv", ["picture", "far"], ["around"], kernel_shape=[SIDE, SIDE], dilations=[APART] * 2, pads=[half * APART] * 4),
        helper.make_node("Add", ["edge", "around"], ["a"]),
        helper.make_node("Relu", ["a"], ["b"]),
        helper.make_node("Conv", ["b", "second", "second_bias"], ["c"], kernel_shape=[1, 1]),
        helper.make_node("Relu", ["c"], ["d"]),
        helper.make_node("Conv", ["d", "third", "third_bias"], ["shares"], kernel_shape=[1, 1]),
    ]
    put, out = (
        helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, [1, channels, "height", "width"])
        for name, channels in (("picture", 3), ("shares", len(things)))
    )
    constants = [arrays.from_array(np.ascontiguousarray(one, np.float32), name) for name, one in weights.items()]
    graph = helper.make_graph(nodes, "mobee", [put], [out], constants)
    model = helper.make_model(graph, producer_name="mobee", ir_version=IR, opset_imports=[helper.make_opsetid("", OPSET)])
    helper.set_model_props(model, {KEY: json.dumps({"format": FORMAT, "things": [asdict(one) for one in things]})})
    onnx.checker.check_model(model)
    return Network(tuple(things), model.SerializeToString())


def load_network(path: str | Path) -> Network:
    """Read a network from a file; raise InvalidValue if the file is not a valid network of MoBeE, NotInstalled without ONNX or OpenCV."""
    onnx = _imported("onnx")
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise InvalidValue(f"{path}: cannot be read ({error.strerror}). `{TRAIN} FILE` writes such a file") from None
    try:
        model = onnx.load_model_from_string(content)
        onnx.checker.check_model(model)
    except Exception as error:  # the reader and the checker have no common base of their errors
        raise InvalidValue(f"{path}: not an ONNX file, or a damaged one ({type(error).__name__}). Make it again: {TRAIN} FILE") from None
    known = {one.key: one.value for one in model.metadata_props}
    try:
        plain: dict[str, Any] = json.loads(known[KEY])
        if plain["format"] != FORMAT:
            raise ValueError
        things = tuple(_thing(one) for one in plain["things"])
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InvalidValue(f"{path}: not a file of `{TRAIN}`: its metadata must have {KEY!r} with the format {FORMAT!r}") from None
    network = Network(things, content)
    try:
        shape = network.shares()(np.zeros((2 * SIDE, 3 * SIDE, 3), np.uint8)).shape
    except InvalidValue as error:
        raise InvalidValue(f"{path}: {error}") from None
    if shape != (len(things), 2 * SIDE, 3 * SIDE):
        raise InvalidValue(f"{path}: the network's output has the shape {shape}, which does not fit its {len(things)} things")
    return network


def _thing(plain: dict[str, Any]) -> Thing:
    """Return the thing that is described in the metadata of a network's file.

    Raises KeyError, TypeError or ValueError if the description is not valid.
    """
    if plain["kind"] not in KINDS:
        raise ValueError(plain["kind"])
    red, green, blue = map(float, plain["color"])
    return Thing(str(plain["name"]), plain["kind"], tuple(map(float, plain["size"])), (red, green, blue), float(plain["tolerance"]))


def _looks(thing: Thing) -> tuple[str, str, tuple[float, ...], tuple[float, ...]]:
    return thing.name, thing.kind, tuple(thing.size), tuple(thing.color)


def _text(looks: tuple[str, str, tuple[float, ...], tuple[float, ...]]) -> str:
    name, kind, size, color = looks
    return f"{name} ({kind}, {' x '.join(f'{one:g}' for one in size)} m, colour {' '.join(f'{one:g}' for one in color)})"


def _imported(name: str) -> Any:
    """Import OpenCV or ONNX when it is needed."""
    try:
        if name == "cv2":
            import cv2

            return cv2
        import onnx

        return onnx
    except ImportError:
        raise NotInstalled(f'a learned detector needs {name}, which is not installed: pip install "mobee[vision]"') from None
