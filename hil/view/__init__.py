"""Page of a plan, a run or a robot in three dimensions: data here, scripts in `web/`.

`hil.view.scene` prepares the data, `hil.view.page` writes the page.
"""
