"""A page that plays a plan, a run or a robot in three dimensions: data here, its scripts in `web/`.

`hil.view.scene` is what is packed into a page, `hil.view.page` writes it.
"""
