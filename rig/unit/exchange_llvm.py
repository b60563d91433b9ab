"""Frames that the child process of a library answers in compiled code: read, step, reply, without Python between them.

A child that has slept wakes with cold caches: its interpreter then takes several times as long for a frame.
The module imports only llvmlite, in a tenth of a second; an import of numba takes a second.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Final

import llvmlite.binding as llvm

# answer: the bytes of the first message that is no FRAME of the session (0: the rig is gone, < 0: no message), or
# that of a step that failed, its code in state[1].  state[0] counts the steps.  It looks for a message ``looks`` times
# before it sleeps.
_TEXT: Final = """
define i64 @answer(i32 %fd, ptr %message, i64 %room, i64 %size, ptr %usual, ptr %output, ptr %blank, i64 %bytes,
                   ptr %state, ptr %step, ptr %receive, ptr %send, ptr %give_way, i32 %at_once, i64 %looks) {
begin:
  %asked = getelementptr i8, ptr %message, i64 16
  %answered = getelementptr i8, ptr %output, i64 16
  %reply_count = getelementptr i8, ptr %output, i64 40
  %code_at = getelementptr i8, ptr %state, i64 8
  br label %look
look:
  %looked = phi i64 [0, %begin], [0, %reply], [%again, %give]
  %got = call i64 %receive(i32 %fd, ptr %message, i64 %room, i32 %at_once)
  %nothing = icmp slt i64 %got, 0
  br i1 %nothing, label %none, label %came
none:
  %again = add i64 %looked, 1
  %patient = icmp slt i64 %again, %looks
  br i1 %patient, label %give, label %sleep
give:
  %gave = call i32 %give_way()
  br label %look
sleep:
  %woken = call i64 %receive(i32 %fd, ptr %message, i64 %room, i32 0)
  br label %came
came:
  %count = phi i64 [%got, %look], [%woken, %sleep]
  %whole = icmp eq i64 %count, %size
  br i1 %whole, label %compare, label %other
compare:
  %head = load i192, ptr %message, align 1
  %head_usual = load i192, ptr %usual, align 1
  %same = icmp eq i192 %head, %head_usual
  br i1 %same, label %frame, label %other
frame:
  call void @llvm.memcpy.p0.p0.i64(ptr align 1 %answered, ptr align 1 %asked, i64 24, i1 false)
  %code = call i32 %step(ptr %message, ptr %output)
  %failed = icmp ne i32 %code, 0
  br i1 %failed, label %refuse, label %reply
reply:
  %before = load i64, ptr %state, align 8
  %stepped = add i64 %before, 1
  store i64 %stepped, ptr %state, align 8
  store i64 %stepped, ptr %reply_count, align 1
  %sent = call i64 %send(i32 %fd, ptr %output, i64 %bytes, i32 0)
  call void @llvm.memcpy.p0.p0.i64(ptr align 1 %output, ptr align 1 %blank, i64 %bytes, i1 false)
  br label %look
refuse:
  %code_long = sext i32 %code to i64
  store i64 %code_long, ptr %code_at, align 8
  br label %other
other:
  ret i64 %count
}
declare void @llvm.memcpy.p0.p0.i64(ptr, ptr, i64, i1)
"""
_held: list[object] = []  # compiled code lives as long as its engine


def compiled() -> Callable[..., int]:
    """Compile ``answer`` of the text above; Python does not interrupt the process within it."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_default_triple().create_target_machine(opt=2)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(_TEXT), target)
    engine.finalize_object()
    _held.append(engine)
    pointer, long = ctypes.c_void_p, ctypes.c_int64
    records, functions = (pointer, long, long, *(pointer,) * 3, long, pointer), (pointer,) * 4
    kind = ctypes.CFUNCTYPE(long, ctypes.c_int, *records, *functions, ctypes.c_int, long)
    return kind(engine.get_function_address("answer"))
