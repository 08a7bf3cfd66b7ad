"""The bus, or logs, in a browser: one page, and the server that feeds it.

Theory of operation
===================

The page is one HTML file that needs nothing else (`page`). What it shows is a list of *sources*, each with rows of
frames and events. A source that is a log stands in the page as columns, every value of it (`columns`); then the page
needs no server, and the file that `field -o x.html` writes is the page that `serve LOG` serves. The source of a live
bus has a description only, and a websocket brings the rest.

On the bus side a `Session` takes every frame into a `Traffic`, as the monitor does, whoever looks. Browsers never slow
that: a browser is sent a *snapshot*, what has changed since its last one, twenty times a second (`server`). It says
when it has it, and one that owes two answers is left out until it catches up: snapshots are skipped, counted, and
shown on the page; frames are not lost by the session.

What a browser asks for is checked as on the command line (`requests`) and done one after the other in a thread of its
own, as it may wait for a node. SDO transfers are the master's, on a bus of its own that shares the one adapter (`tap`).

What only some networks have is a `Panel`: a script of its own, a description, and the events that it makes of
messages. Nothing here knows the robot.

Who may look is judged before anything else (`access`): the page of a machine is for that machine unless another
address is asked for, and then it takes a token.
"""
