"""The live page: a separate process that shows a session and sends back button presses.

Nothing here can delay or stop a recording: the session passes copies through a bounded queue and never waits.
"""
