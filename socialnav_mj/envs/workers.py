"""Workers that are asked together: an answer for each question, or one clear error and an end of all."""

from collections.abc import Callable, Sequence
from time import monotonic
from typing import Any

from socialnav_mj.envs.guided import GuidedCrowd
from socialnav_mj.envs.worker import PATIENCE, Failure, SharedSlots, Worker, command


class Workers:
    """A process for each of several crowds.

    Whatever comes between questions and answers, a death or an interruption, ends them all: an answer that is still on
    its way would be taken for one to a later question. After an exception inside a crowd they go on.
    """

    def __init__(self, makes: Sequence[Callable[[], GuidedCrowd]], shared: SharedSlots, n_slots: int) -> None:
        """Start the processes, and wait until each has built its first scene.

        Args:
            makes: Make the crowds, there.
            shared: Slots of all crowds, one crowd's after another's.
            n_slots: Slots of each.

        Raises:
            WorkerError: If one raises or dies.
        """
        self._workers: list[Worker] = []
        self._asked: Sequence[Worker] = ()
        self._is_closed = False
        try:
            for scene, make in enumerate(makes):
                rows = slice(scene * n_slots, (scene + 1) * n_slots)
                name = f"worker {scene} of 0 to {len(makes) - 1} (environments {rows.start} to {rows.stop - 1})"
                self._workers.append(Worker(name, make, shared, rows))
            self._asked = self._workers
            self.answers()
        except BaseException:
            self.close()
            raise

    def __len__(self) -> int:
        return len(self._workers)

    @property
    def are_asked(self) -> bool:
        """Answers are owed."""
        return bool(self._asked)

    def check(self) -> None:
        """See whether they can be asked.

        Raises:
            RuntimeError: If they are closed, or owe answers.
        """
        if self._is_closed:
            raise RuntimeError("these scenes are closed; make them anew")
        if self.are_asked:
            raise RuntimeError("a step is under way; call step_wait first")

    def send(self, contents: Sequence[bytes], scenes: Sequence[int] | None = None) -> None:
        """Ask without waiting.

        Args:
            contents: Of `socialnav_mj.envs.worker.command`, one a worker.
            scenes: Numbers of the workers; None for all.

        Raises:
            RuntimeError: If they are closed, or owe answers.
            WorkerError: If one has died.
        """
        self.check()
        self._asked = self._workers if scenes is None else [self._workers[scene] for scene in scenes]
        try:
            for worker, content in zip(self._asked, contents, strict=True):
                worker.send(content)
        except BaseException:
            self.close()
            raise

    def answers(self) -> list[Any]:
        """Wait for the answers to what was sent.

        Returns:
            One for each worker that was asked.

        Raises:
            AttributeError: If a crowd lacks an attribute.
            WorkerError: If a crowd raises anything else, or a worker dies.
        """
        try:
            asked = self._asked
            answers = [worker.receive() for worker in asked]
            self._asked = ()
        except BaseException:
            self.close()
            raise
        for worker, answer in zip(asked, answers, strict=True):
            if isinstance(answer, Failure):
                answer.raise_here(worker.name)
        return answers

    def ask(self, name: str, *args: Any, scenes: Sequence[int] | None = None) -> list[Any]:
        """Give workers the same command and wait for their answers.

        Args:
            name: Of the command.
            *args: Its arguments.
            scenes: Numbers of the workers; None for all.

        Returns:
            One answer a worker.

        Raises:
            RuntimeError: If they are closed, or owe answers.
            AttributeError: If a crowd lacks an attribute.
            WorkerError: If a crowd raises anything else, or a worker dies.
        """
        self.send([command(name, *args)] * (len(self) if scenes is None else len(scenes)), scenes)
        return self.answers()

    def close(self) -> None:
        """End the processes."""
        if self._is_closed:
            return
        self._is_closed, self._asked = True, ()
        deadline = monotonic() + PATIENCE
        for worker in self._workers:
            worker.hang_up()
        for worker in self._workers:
            worker.end(deadline - monotonic())
