# SPDX-License-Identifier: Apache-2.0
"""Reactive control (thesis chapter 5): constraint forces, the control law, reaching, and the test whether a part has come to rest."""

from mobee.control.controller import Controller as Controller
from mobee.control.forces import Forces as Forces
from mobee.control.forces import State as State
from mobee.control.forces import Term as Term
from mobee.control.forces import constraint_forces as constraint_forces
from mobee.control.gains import Gains as Gains
from mobee.control.gains import Settle as Settle
from mobee.control.gains import SettleTest as SettleTest
from mobee.control.law import Command as Command
from mobee.control.reach import Reacher as Reacher
from mobee.control.reach import ReachPath as ReachPath
from mobee.control.reach import reach_path as reach_path
