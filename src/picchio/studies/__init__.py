"""Questions asked of a model: what a riveting task does to its joints."""

from __future__ import annotations

from picchio.studies.assess import assess
from picchio.studies.assessment import Assessment, JointLife, OperationResult
from picchio.studies.task import Operation, Task, load_task, task_from_dict

__all__ = [
    "Assessment",
    "JointLife",
    "Operation",
    "OperationResult",
    "Task",
    "assess",
    "load_task",
    "task_from_dict",
]
