"""The bus, or logs, in a browser: one page, and the server that feeds it.

Theory of operation. The page is one HTML file that needs nothing else (`page`). It shows a list of *sources*, each with
rows of frames and with events. A log is a source whose values are all in the page, as columns (`content`); the page
then needs no server, and the file that `field -o x.html` writes is the page that `serve LOG` serves. Of a long log it
has a window, and asks the server for others (`longlog`). The source of a live bus has only a description, and a
websocket brings the rest.

On the bus side a `Session` takes every frame into a `Traffic`, as the monitor does, whoever is looking, and into a
bounded *history*. Browsers never slow that down: twenty times a second a browser is sent a *snapshot*, which has what
has changed since its last one, and the next stretch of the history (`server`). It confirms each, and a browser that
owes three confirmations is left out until it catches up. So a page has every frame, also after it was loaded again; one
that is so slow that the history no longer has them counts what it has missed.

`events` says what happens besides: nodes that are lost and back, states of drives, EMCY, aborts.

What a browser asks for is checked as on the command line (`requests`), and done one request after the other on a thread
of its own, as it may wait for a node. SDO transfers belong to a master with a bus of its own that shares the adapter
(`tap`).

The view of files needs no bus: the browser holds the text of an EDS and the history of its edits, and the `editor`
makes each edit of the text that comes with it, as the command `edit` does.

A view that only some networks have is a `Panel`: a script of its own, a description, and the events that it makes of
messages. Nothing in here knows the robot.

Who may look is decided before anything else (`access`): the page of a machine is for that machine unless another
address is asked for, and then it takes a token.
"""
